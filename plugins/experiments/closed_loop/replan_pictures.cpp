#include "replan_pictures.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr int kRound = 24;  ///< Corners of a circle.
constexpr int kPathPoints = 200;

/// Points whose convex hull, seen from above, is that of the shape.
struct HullPoints {
  const Transform& T_world_shape;
  std::vector<Eigen::Vector3d> points;

  void add(const Eigen::Vector3d& p_shape) { points.emplace_back(T_world_shape * p_shape); }
  /// A ball about a point of the shape.
  void add_ball(const Eigen::Vector3d& centre, double radius_m) {
    for (int i = 0; i < kRound; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / kRound;
      points.emplace_back(T_world_shape * centre +
                          radius_m * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0));
    }
  }
  void operator()(const Box& box) {
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d side((corner & 1) != 0 ? 0.5 : -0.5, (corner & 2) != 0 ? 0.5 : -0.5,
                                 (corner & 4) != 0 ? 0.5 : -0.5);
      add(side.cwiseProduct(box.size_m));
    }
  }
  void operator()(const Sphere& sphere) { add_ball(Eigen::Vector3d::Zero(), sphere.radius_m); }
  void operator()(const Cylinder& cylinder) {
    for (int i = 0; i < kRound; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / kRound;
      for (const double end : {-0.5, 0.5}) {
        add({cylinder.radius_m * std::cos(angle), cylinder.radius_m * std::sin(angle),
             end * cylinder.length_m});
      }
    }
  }
  void operator()(const Capsule& capsule) {
    for (const double end : {-0.5, 0.5}) {
      add_ball({0.0, 0.0, end * capsule.length_m}, capsule.radius_m);
    }
  }
  void operator()(const HalfSpace&) {}
  void operator()(const std::shared_ptr<const Mesh>& mesh) {
    for (const Eigen::Vector3d& vertex : mesh->vertices_m) add(vertex);
  }
};

double turn(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

/// Andrew's monotone chain.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::ranges::sort(points, [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = hull.size();
    for (const Eigen::Vector2d& point : points) {
      while (hull.size() >= base + 2 && turn(hull[hull.size() - 2], hull.back(), point) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    if (!hull.empty()) hull.pop_back();
    std::ranges::reverse(points);
  }
  return hull;
}

StoredArray array_of(const std::vector<Eigen::Vector2d>& points) {
  StoredArray array{static_cast<int>(points.size()), 2, {}};
  for (const Eigen::Vector2d& point : points) {
    array.values.push_back(static_cast<float>(point.x()));
    array.values.push_back(static_cast<float>(point.y()));
  }
  return array;
}

/// A robot's spheres from above.
class FromAbove {
 public:
  explicit FromAbove(const RobotModel& robot)
      : robot_(robot), centres_(robot.description().spheres.size()) {}

  [[nodiscard]] bool has_spheres() const { return !centres_.empty(); }
  /// x, y and radius of each sphere.
  StoredArray spheres(std::span<const double> q) {
    place(q);
    StoredArray array{static_cast<int>(centres_.size()), 3, {}};
    for (std::size_t s = 0; s < centres_.size(); ++s) {
      for (const double value :
           {centres_[s].x(), centres_[s].y(), robot_.description().spheres[s].radius_m}) {
        array.values.push_back(static_cast<float>(value));
      }
    }
    return array;
  }
  /// Of the sphere nearest to the root, and of the last.
  std::pair<Eigen::Vector2d, Eigen::Vector2d> base_and_hand(std::span<const double> q) {
    place(q);
    return {centres_.front().head<2>(), centres_.back().head<2>()};
  }

 private:
  void place(std::span<const double> q) { robot_.sphere_centres(q, centres_, scratch_); }

  const RobotModel& robot_;
  std::vector<Eigen::Vector3d> centres_;
  Scratch scratch_;
};

struct Ways {
  std::vector<Eigen::Vector2d> base, hand;

  void add(const std::pair<Eigen::Vector2d, Eigen::Vector2d>& points) {
    base.push_back(points.first);
    hand.push_back(points.second);
  }
};

Ways way_so_far(const EpisodeRecord& episode, std::size_t last, FromAbove& view) {
  Ways ways;
  const std::size_t stride = 1 + last / kPathPoints;
  for (std::size_t i = 0; i <= last; i += stride) {
    ways.add(view.base_and_hand(as_span(episode.poses[i].q)));
  }
  return ways;
}

/// What is left to follow at a time, if anything is followed.
Ways way_ahead(const EpisodeRecord& episode, double time_s, FromAbove& view) {
  Ways ways;
  const FollowedPath* followed = nullptr;
  for (const FollowedPath& path : episode.followed) {
    if (path.start_s <= time_s && path.trajectory.size() > 0) followed = &path;
  }
  if (followed == nullptr) return ways;
  const Trajectory& trajectory = followed->trajectory;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  const double from_s = time_s - followed->start_s;
  for (int i = 0; i <= kPathPoints; ++i) {
    const double share = static_cast<double>(i) / kPathPoints;
    trajectory.sample(from_s + share * std::max(0.0, trajectory.duration_s() - from_s), q, {});
    ways.add(view.base_and_hand(q));
  }
  return ways;
}

}  // namespace

std::vector<Eigen::Vector2d> outline_from_above(const Shape& shape,
                                                const Transform& T_world_shape) {
  HullPoints hull{T_world_shape, {}};
  std::visit(hull, shape);
  std::vector<Eigen::Vector2d> flat;
  for (const Eigen::Vector3d& point : hull.points) flat.emplace_back(point.head<2>());
  return convex_hull(std::move(flat));
}

void record_pictures(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                     Recorder& recorder) {
  FromAbove view(robot);
  if (episode.poses.empty() || !view.has_spheres()) return;
  const std::string series = "picture/" + std::to_string(episode.episode);
  for (int p = 0; p < pictures; ++p) {
    const double share = pictures == 1 ? 1.0 : static_cast<double>(p) / (pictures - 1);
    const double time_s = episode.begin_s + share * episode.duration_s;
    const auto after = std::ranges::lower_bound(episode.poses, time_s, {}, &TruePose::time_s);
    const auto at = std::min<std::size_t>(static_cast<std::size_t>(after - episode.poses.begin()),
                                          episode.poses.size() - 1);
    recorder.add(series, p, "time_s", time_s);
    recorder.add(series, p, "robot", view.spheres(as_span(episode.poses[at].q)));
    const Ways behind = way_so_far(episode, at, view);
    recorder.add_filled(series, p, "way.base", array_of(behind.base));
    recorder.add_filled(series, p, "way.hand", array_of(behind.hand));
    const Ways ahead = way_ahead(episode, time_s, view);
    recorder.add_filled(series, p, "plan.base", array_of(ahead.base));
    recorder.add_filled(series, p, "plan.hand", array_of(ahead.hand));
    recorder.add(series, p, "goal", view.spheres(as_span(episode.q_goal)));
    if (!episode.scene) continue;
    int count = 0;
    for (const SceneObject& object : episode.scene->objects()) {
      const auto outline = outline_from_above(object.shape, object.T_world_object(time_s));
      if (outline.empty()) continue;
      const std::string key = "object." + std::to_string(count++);
      recorder.add(series, p, key, array_of(outline));
      recorder.add(series, p, key + ".moves", object.moves());
    }
    recorder.add(series, p, "objects", count);
  }
}

}  // namespace sidestep
