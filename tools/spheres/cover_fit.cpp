#include "cover_fit.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

#include "cluster_fit.hpp"

namespace sidestep {
namespace {

/// Spheres of one link that hold one of its shapes completely.
struct ShapeCover {
  std::vector<BodySphere> spheres;
  double protrusion_m = 0.0;  ///< How far they stand out from the shapes of the body, at most.
  double excess_m3 = 0.0;     ///< What of their union lies outside of the shapes of the body.
};

constexpr std::size_t kCoverSamples = 512;
/// Covers what rounding would leave bare.
constexpr double kRadiusMargin = 1.0 + 1e-9;
constexpr int kLargestRing = 8;

/// In the shape's frame.
struct Ball {
  Eigen::Vector3d p_shape;
  double radius_m;
};
using Balls = std::vector<Ball>;

/// A ring of n >= 3 discs that cover a disc of radius 1: each holds a sector.
struct Ring {
  double centre;  ///< Of each disc, from the middle.
  double radius;  ///< Of each disc.
};
Ring ring_of(int n) {
  const double half_angle = std::numbers::pi / n;
  if (n == 3) return {std::cos(half_angle), std::sin(half_angle)};
  return {0.5 / std::cos(half_angle), 0.5 / std::cos(half_angle)};  // through the middle
}

/// `slices` along the axis, of one sphere or a ring of some.
Balls stack(const Cylinder& cylinder, int slices, int around) {
  const double slice_half = 0.5 * cylinder.length_m / slices;
  const Ring ring = around == 1 ? Ring{0.0, 1.0} : ring_of(around);
  const double out = ring.centre * cylinder.radius_m;
  const double radius = std::hypot(ring.radius * cylinder.radius_m, slice_half) * kRadiusMargin;
  Balls balls;
  for (int i = 0; i < slices; ++i) {
    const double z = -0.5 * cylinder.length_m + (2 * i + 1) * slice_half;
    for (int j = 0; j < around; ++j) {
      const double angle = 2.0 * std::numbers::pi * j / around;
      balls.push_back({{out * std::cos(angle), out * std::sin(angle), z}, radius});
    }
  }
  return balls;
}

Balls grid(const Box& box, const Eigen::Vector3i& cells) {
  const Eigen::Vector3d half = 0.5 * box.size_m.cwiseQuotient(cells.cast<double>());
  Balls balls;
  for (int i = 0; i < cells.x(); ++i) {
    for (int j = 0; j < cells.y(); ++j) {
      for (int k = 0; k < cells.z(); ++k) {
        const Eigen::Vector3d at(2 * i + 1 - cells.x(), 2 * j + 1 - cells.y(),
                                 2 * k + 1 - cells.z());
        balls.push_back({at.cwiseProduct(half), half.norm() * kRadiusMargin});
      }
    }
  }
  return balls;
}

/// Spheres at both ends and n - 1 between them.
Balls row(const Capsule& capsule, int n) {
  const double step = capsule.length_m / n;
  Balls balls;
  for (int i = 0; i <= n; ++i) {
    balls.push_back({{0.0, 0.0, -0.5 * capsule.length_m + i * step},
                     std::hypot(capsule.radius_m, 0.5 * step) * kRadiusMargin});
  }
  return balls;
}

/// All arrangements of at most `most` spheres.
struct Arrangements {
  int most;

  std::vector<Balls> operator()(const Box& box) const {
    std::vector<Balls> all;
    for (Eigen::Vector3i cells = Eigen::Vector3i::Ones(); cells.prod() <= most;) {
      all.push_back(grid(box, cells));
      int longest = 0;
      box.size_m.cwiseQuotient(cells.cast<double>()).maxCoeff(&longest);
      ++cells[longest];
    }
    return all;
  }
  std::vector<Balls> operator()(const Sphere& sphere) const {
    return {{{Eigen::Vector3d::Zero(), sphere.radius_m}}};
  }
  std::vector<Balls> operator()(const Cylinder& cylinder) const {
    std::vector<Balls> all;
    for (int around = 1; around <= kLargestRing; around += around == 1 ? 2 : 1) {
      for (int slices = 1; around * slices <= most; ++slices) {
        all.push_back(stack(cylinder, slices, around));
      }
    }
    return all;
  }
  std::vector<Balls> operator()(const Capsule& capsule) const {
    std::vector<Balls> all{{{Eigen::Vector3d::Zero(), capsule.radius_m + 0.5 * capsule.length_m}}};
    for (int n = 1; n < most; ++n) all.push_back(row(capsule, n));
    return all;
  }
  std::vector<Balls> operator()(const HalfSpace&) const { return {}; }
  std::vector<Balls> operator()(const std::shared_ptr<const Mesh>&) const { return {}; }
};

/// In the frame of the body.
std::vector<std::vector<BodySphere>> arrangements(const BodyPart& part, int most) {
  std::vector<std::vector<BodySphere>> all;
  for (const Balls& balls : std::visit(Arrangements{most}, part.shape)) {
    std::vector<BodySphere>& spheres = all.emplace_back();
    for (const Ball& ball : balls) {
      spheres.push_back({part.link, part.T_body_shape * ball.p_shape, ball.radius_m});
    }
  }
  return all;
}

/// A mesh has no axis to go by: ever finer clusters.
std::vector<std::vector<BodySphere>> mesh_clusters(const RigidBody& body, const BodyPart& part,
                                                   int most, const std::stop_token& stop) {
  RigidBody alone{body.links, {part}};
  const double size = bounds_of(part.shape).half_m.norm();
  std::vector<std::vector<BodySphere>> all;
  for (double protrusion = size; protrusion > 0.01 * size; protrusion *= 0.7) {
    ClusterFit fit(alone, part.link, {}, {protrusion, 0.2 * protrusion});
    fit.reach_protrusion(most, stop);
    all.push_back(spheres_of(alone, fit.result()));
    if (static_cast<int>(all.back().size()) >= most || stop.stop_requested()) break;
  }
  return all;
}

ShapeCover measured(const RigidBody& body, std::vector<BodySphere> spheres,
                    const std::vector<Eigen::Vector3d>& within) {
  ShapeCover cover;
  for (const BodySphere& sphere : spheres) {
    const double r = sphere.radius_m;
    cover.protrusion_m = std::max(cover.protrusion_m, r + signed_distance_m(body, sphere.p_body));
    double outside = 0.0;
    for (const Eigen::Vector3d& unit : within) {
      const Eigen::Vector3d p_body = sphere.p_body + r * unit;
      if (signed_distance_m(body, p_body) <= 0.0) continue;
      const auto holding = std::ranges::count_if(spheres, [&](const BodySphere& other) {
        return (p_body - other.p_body).squaredNorm() <= other.radius_m * other.radius_m;
      });
      outside += 1.0 / static_cast<double>(std::max<std::ptrdiff_t>(1, holding));
    }
    cover.excess_m3 += 4.0 / 3.0 * std::numbers::pi * r * r * r * outside / kCoverSamples;
  }
  cover.spheres = std::move(spheres);
  return cover;
}

/// Covers of a shape with ever more spheres, each with less excess than all with fewer spheres:
/// stacks along the axis of a cylinder, of single spheres and of rings, grids over a box, rows
/// along a capsule, clusters of a mesh. `most_spheres` in the largest. [any]; allocates.
std::vector<ShapeCover> shape_covers(const RigidBody& body, const BodyPart& part, int most_spheres,
                                     const std::stop_token& stop) {
  const bool is_mesh = std::holds_alternative<std::shared_ptr<const Mesh>>(part.shape);
  auto all =
      is_mesh ? mesh_clusters(body, part, most_spheres, stop) : arrangements(part, most_spheres);
  const std::vector<Eigen::Vector3d> within = even_in_ball(kCoverSamples);
  std::vector<ShapeCover> covers;
  for (auto& spheres : all) covers.push_back(measured(body, std::move(spheres), within));
  std::ranges::stable_sort(covers, [](const ShapeCover& a, const ShapeCover& b) {
    return std::pair(a.spheres.size(), a.excess_m3) < std::pair(b.spheres.size(), b.excess_m3);
  });
  double least = std::numeric_limits<double>::infinity();
  std::erase_if(covers, [&](const ShapeCover& cover) {
    const bool is_worse = cover.excess_m3 >= least;
    least = std::min(least, cover.excess_m3);
    return is_worse;
  });
  return covers;
}

/// Boxes at the surface, as a share of the protrusion that is aimed at.
constexpr double kFineShare = 0.2;
/// Spheres of one shape, where there is a number to be shared out.
constexpr int kMostSpheresOnShape = 48;
/// Of a body, to find out what is held twice.
constexpr double kFineOfRadius = 0.05;
constexpr std::size_t kMostCells = 60'000;

double volume_m3(const RigidBody& body, int link) {
  double sum = 0.0;
  for (const BodyPart& part : body.parts) {
    if (part.link == link) sum += 8.0 * bounds_of(part.shape).half_m.prod();
  }
  return sum;
}

/// The links with shapes, the largest first: its spheres may hold small ones beside it.
std::vector<int> links_by_size(const RigidBody& body) {
  std::vector<int> links;
  for (const BodyLink& one : body.links) {
    if (volume_m3(body, one.link) > 0.0) links.push_back(one.link);
  }
  std::ranges::stable_sort(links, std::ranges::greater{},
                           [&](int link) { return volume_m3(body, link); });
  return links;
}

void append(std::vector<CollisionSphere>& all, const std::vector<CollisionSphere>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// A link that is to be fitted.
struct Task {
  const RigidBody* body;
  int link;
  Held held;
};

/// Of the robot, or of the one link that is named.
std::vector<Task> tasks(const std::vector<RigidBody>& bodies,
                        const std::vector<CollisionSphere>& kept, const std::optional<int>& link) {
  std::vector<Task> all;
  for (const RigidBody& body : bodies) {
    std::vector<int> done;
    for (const int one : links_by_size(body)) {
      if (link && one != *link) continue;
      all.push_back({&body, one, {spheres_of(body, kept), done}});
      done.push_back(one);
    }
  }
  return all;
}

std::vector<CollisionSphere> fit_to_protrusion(std::vector<Task> links,
                                               std::vector<CollisionSphere> spheres,
                                               double protrusion_m, const std::stop_token& stop) {
  for (Task& task : links) {
    task.held.spheres = spheres_of(*task.body, spheres);
    ClusterFit fit(*task.body, task.link, task.held, {protrusion_m, kFineShare * protrusion_m});
    fit.reach_protrusion(FitGoal::kMostSpheresOnLink, stop);
    append(spheres, fit.result());
  }
  return spheres;
}

/// A shape, and which of its covers is taken.
struct Choice {
  std::vector<ShapeCover> covers;
  std::size_t taken = 0;

  [[nodiscard]] int spheres() const { return static_cast<int>(covers[taken].spheres.size()); }
  struct Step {
    std::size_t to = 0;
    int spheres = 0;       ///< More than now.
    double gain_m3 = 0.0;  ///< Less excess for each of these.
  };
  /// The one that gains the most a sphere, with at most so many more.
  [[nodiscard]] Step best_step(int most_more) const {
    Step best;
    for (std::size_t to = taken + 1; to < covers.size(); ++to) {
      const int more = static_cast<int>(covers[to].spheres.size()) - spheres();
      if (more > most_more) break;
      const double gain = (covers[taken].excess_m3 - covers[to].excess_m3) / more;
      if (gain > best.gain_m3) best = {to, more, gain};
    }
    return best;
  }
};

/// Shares the spheres out among the shapes: each time to the one where they save the most.
void share_out(std::vector<Choice>& choices, int most_spheres) {
  int left = most_spheres;
  for (const Choice& choice : choices) left -= choice.spheres();
  while (left > 0) {
    Choice* chosen = nullptr;
    Choice::Step step;
    for (Choice& choice : choices) {
      const Choice::Step one = choice.best_step(left);
      if (one.gain_m3 <= step.gain_m3) continue;
      step = one;
      chosen = &choice;
    }
    if (chosen == nullptr) return;
    chosen->taken = step.to;
    left -= step.spheres;
  }
}

/// Removes spheres of the links that others of the body make superfluous, the smallest first.
void drop_held(const RigidBody& body, const std::vector<int>& links,
               std::vector<BodySphere>& spheres) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const BodySphere& sphere : spheres) smallest = std::min(smallest, sphere.radius_m);
  std::vector<Cell> cells;
  for (const int link : links) {
    const auto more = link_cells(body, link, {}, kFineOfRadius * smallest, kMostCells);
    cells.insert(cells.end(), more.begin(), more.end());
  }
  const auto holds = [&](const BodySphere& sphere, const Cell& cell) {
    const BodyPart& part = body.parts[static_cast<std::size_t>(cell.part)];
    return farthest_m(cell, part.T_shape_body * sphere.p_body) <= sphere.radius_m;
  };
  std::vector<int> holders(cells.size(), 0);
  for (const BodySphere& sphere : spheres) {
    for (std::size_t i = 0; i < cells.size(); ++i) holders[i] += holds(sphere, cells[i]) ? 1 : 0;
  }
  std::ranges::stable_sort(spheres, {}, &BodySphere::radius_m);
  const auto is_near = [&](const BodySphere& sphere, const Cell& cell) {
    const BodyPart& part = body.parts[static_cast<std::size_t>(cell.part)];
    return (part.T_shape_body * sphere.p_body - cell.p_shape).norm() <=
           sphere.radius_m + cell.half_m.norm();
  };
  std::erase_if(spheres, [&](const BodySphere& sphere) {
    if (std::ranges::count(links, sphere.link) == 0) return false;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const bool is_needed =
          is_near(sphere, cells[i]) && holders[i] - (holds(sphere, cells[i]) ? 1 : 0) <= 0;
      if (is_needed) return false;
    }
    for (std::size_t i = 0; i < cells.size(); ++i) holders[i] -= holds(sphere, cells[i]) ? 1 : 0;
    return true;
  });
}

/// In the frames of their links, rounded, and so much larger that they hold what they held.
std::vector<CollisionSphere> in_links(const RigidBody& body,
                                      const std::vector<BodySphere>& spheres) {
  std::vector<CollisionSphere> out;
  for (const BodySphere& sphere : spheres) {
    const Eigen::Vector3d exact = body.find(sphere.link)->T_body_link.inverse() * sphere.p_body;
    const Eigen::Vector3d centre = to_grain(exact);
    out.push_back({sphere.link, centre, up_to_grain(sphere.radius_m + (centre - exact).norm())});
  }
  return out;
}

std::vector<CollisionSphere> fit_to_count(const std::vector<RigidBody>& bodies,
                                          const std::vector<CollisionSphere>& kept,
                                          const FitGoal& goal, const std::stop_token& stop) {
  std::vector<Choice> choices;
  for (const Task& task : tasks(bodies, kept, goal.link)) {
    for (const BodyPart& part : task.body->parts) {
      if (part.link != task.link) continue;
      Choice choice{shape_covers(*task.body, part, kMostSpheresOnShape, stop)};
      if (!choice.covers.empty()) choices.push_back(std::move(choice));
    }
  }
  share_out(choices, *goal.most_spheres);
  std::vector<CollisionSphere> spheres = kept;
  for (const RigidBody& body : bodies) {
    std::vector<int> links = links_by_size(body);
    if (goal.link) std::erase_if(links, [&](int link) { return link != *goal.link; });
    std::vector<BodySphere> chosen = spheres_of(body, kept);
    for (const Choice& choice : choices) {
      for (const BodySphere& sphere : choice.covers[choice.taken].spheres) {
        if (std::ranges::count(links, sphere.link) > 0) chosen.push_back(sphere);
      }
    }
    if (chosen.empty() || links.empty()) continue;
    drop_held(body, links, chosen);
    std::erase_if(chosen,
                  [&](const BodySphere& one) { return std::ranges::count(links, one.link) == 0; });
    append(spheres, in_links(body, chosen));
  }
  return spheres;
}

}  // namespace

std::vector<CollisionSphere> fit_cover(const std::vector<RigidBody>& bodies,
                                       const std::vector<CollisionSphere>& now, const FitGoal& goal,
                                       const std::stop_token& stop) {
  std::vector<CollisionSphere> kept;
  if (goal.link) {
    std::ranges::copy_if(now, std::back_inserter(kept),
                         [&](const CollisionSphere& sphere) { return sphere.link != *goal.link; });
  }
  std::vector<CollisionSphere> spheres =
      goal.most_spheres
          ? fit_to_count(bodies, kept, goal, stop)
          : fit_to_protrusion(tasks(bodies, kept, goal.link), kept, goal.protrusion_m, stop);
  std::ranges::stable_sort(spheres, {}, &CollisionSphere::link);
  return spheres;
}

}  // namespace sidestep
