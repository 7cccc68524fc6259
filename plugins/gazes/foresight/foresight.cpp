#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

#include "views.hpp"

namespace {

using namespace sidestep;

struct Options : ViewOptions {
  double haste_s = 4.0;
  double track_weight = 100.0;
  double block_weight = 200.0;
  double around_weight = 2.0;

  static Parameters<Options> parameters() {
    using O = Options;
    return declare_views<O>()
        .add("haste_s", &O::haste_s, "What the robot sweeps so much later counts 1/e as much.",
             {.unit = "s", .min = 0.1, .max = 60.0})
        .add("track_weight", &O::track_weight,
             "Of a tracked person beside the robot, in places of 0.1 m on its way.",
             {.min = 0.0, .max = 1000.0})
        .add("block_weight", &O::block_weight,
             "Of all that stands beside the robot where its way is blocked, likewise.",
             {.min = 0.0, .max = 1000.0})
        .add("around_weight", &O::around_weight,
             "Of each of 24 places around the robot from where somebody may come, likewise.",
             {.min = 0.0, .max = 1000.0});
  }
};

/// In which an image is taken, once the head is at rest.
constexpr double kDwell_s = 0.15;
/// What a frame has not shown though it was looked at is not looked at again sooner.
constexpr double kVain_s = 1.5;
/// What the robot sweeps so long after something blocks its way may be blocked, too.
constexpr double kBlock_s = 1.0;
/// What is farther than this beside the robot does not block its way.
constexpr double kBeside_m = 0.1;
/// How far off somebody who is tracked counts 1/e as much.
constexpr double kNear_m = 1.5;
constexpr double kTrackStale_s = 0.4;
/// In which somebody may have come to where nobody was.
constexpr double kAroundStale_s = 2.0;
/// First directions of which the best second one is looked for.
constexpr std::size_t kFirsts = 16;

/// Weighs what the robot will sweep by when, and by how long ago it was looked at, beside people
/// and where they may come from; and looks where, with what is best to look at then, most is seen
/// a second.
class Foresight final : public Gaze {
 public:
  explicit Foresight(const Options& options) : options_(options), looked_at_(options.range_m) {}

  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    looked_at_.note(request);
    if (request.field == nullptr) return request.at;
    weigh(request);
    const Directions directions(request, options_, places_, worths_);
    return directions.angles(best(request, directions));
  }
  [[nodiscard]] bool wants_tracks() const noexcept override { return true; }

 private:
  void weigh(const GazeRequest& request) {
    const Eigen::Vector3d eye_m =
        request.head.T_world_camera(request.at, request.T_world_link).translation();
    const Sight sight(request);
    // What blocks the way is as urgent as what is near.
    const double blocked_s = request.way_blocked_s.value_or(0.0) - request.way_from_s;
    places_ = swept_places(request, 0.0, std::max(options_.horizon_s, blocked_s + kBlock_s));
    worths_.clear();
    for (const Place& place : places_) {
      const double off_s = request.way_blocked_s ? std::abs(place.time_s - blocked_s) : kInfinity;
      const double haste = std::exp(-std::min(place.time_s, off_s) / options_.haste_s);
      worths_.push_back(static_cast<float>(haste * doubt(place.p_m, request.now, sight)));
    }
    if (request.way_blocked_s) add_what_blocks(request, sight);
    if (request.tracks != nullptr) add_people(*request.tracks, request.now, eye_m);
    if (request.moving != nullptr) add_moving(*request.moving, request.now, eye_m);
    add_surroundings(request, eye_m);
    for (std::size_t k = 0; k < places_.size(); ++k) {
      if (worths_[k] > 0.0F && !sight.reaches(places_[k].p_m)) worths_[k] = 0.0F;
    }
  }

  /// How likely a place is not what the map has there.
  [[nodiscard]] double doubt(const Eigen::Vector3d& p_m, Stamp now, const Sight& sight) const {
    const double age_s = looked_at_.age_s(p_m, now);
    return -std::expm1(-age_s / (sight.knows(p_m) ? options_.stale_s : kVain_s));
  }

  /// What of the map is so near to the robot where its way is blocked that it may be what blocks
  /// it: together as much as `block_weight`.
  void add_what_blocks(const GazeRequest& request, const Sight& sight) {
    const Trajectory& way = *request.way;
    const std::vector<CollisionSphere>& spheres = request.robot.description().spheres;
    std::vector<double> q(idx(way.dof));
    way.sample(*request.way_blocked_s, q, {});
    std::vector<Eigen::Vector3d> points_m(spheres.size());
    std::vector<Eigen::Vector3d> gradients(spheres.size());
    std::vector<double> distances_m(spheres.size());
    Scratch scratch;
    request.robot.sphere_centres(q, points_m, scratch);
    request.field->query(points_m, distances_m, gradients, {});
    std::size_t near = 0;
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      if (!(distances_m[i] < spheres[i].radius_m + kBeside_m)) continue;
      points_m[near++] = points_m[i] - distances_m[i] * gradients[i].stableNormalized();
    }
    for (const Eigen::Vector3d& p_m : std::span(points_m).first(near)) {
      const double weight = options_.block_weight / static_cast<double>(near);
      places_.push_back({p_m});
      worths_.push_back(static_cast<float>(weight * doubt(p_m, request.now, sight)));
    }
  }

  void add_people(const Tracks& tracks, Stamp now, const Eigen::Vector3d& eye_m) {
    for (const Track& track : tracks.tracks) {
      const double middle_m = 0.5 * (track.bottom_m + track.top_m);
      add_somebody({track.position_m.x(), track.position_m.y(), middle_m}, options_.track_weight,
                   now.seconds() - track.last_seen.seconds(), eye_m);
    }
  }

  /// What has been out of view since it moved, tracked or not: together as much as one person.
  void add_moving(const MovingObstacles& moving, Stamp now, const Eigen::Vector3d& eye_m) {
    const auto unseen = std::ranges::count_if(
        moving.balls, [](const MovingBall& ball) { return ball.seen.has_value(); });
    for (const MovingBall& ball : moving.balls) {
      if (!ball.seen) continue;
      add_somebody(ball.centre_m, options_.track_weight / static_cast<double>(unseen),
                   now.seconds() - ball.seen->seconds(), eye_m);
    }
  }

  void add_somebody(const Eigen::Vector3d& p_m, double weight, double unseen_s,
                    const Eigen::Vector3d& eye_m) {
    const double nearness = std::exp(-(p_m - eye_m).head<2>().norm() / kNear_m);
    places_.push_back({p_m});
    worths_.push_back(static_cast<float>(-weight * nearness *
                                         std::expm1(-std::max(0.0, unseen_s) / kTrackStale_s)));
  }

  void add_surroundings(const GazeRequest& request, const Eigen::Vector3d& eye_m) {
    constexpr int kBearings = 12;
    constexpr double kHip_m = 0.9;
    for (const double away_m : {1.5, 3.0}) {
      for (int i = 0; i < kBearings; ++i) {
        const double bearing_rad = 2.0 * std::numbers::pi * i / kBearings;
        const Eigen::Vector3d p_m(eye_m.x() + away_m * std::cos(bearing_rad),
                                  eye_m.y() + away_m * std::sin(bearing_rad), kHip_m);
        places_.push_back({p_m});
        const double age_s = looked_at_.age_s(p_m, request.now);
        worths_.push_back(
            static_cast<float>(-options_.around_weight * std::expm1(-age_s / kAroundStale_s)));
      }
    }
  }

  [[nodiscard]] std::size_t best(const GazeRequest& request, const Directions& directions) const {
    RobotDescription joints;
    joints.joints = {request.head.description().pan.joint, request.head.description().tilt.joint};
    const MotionLimits limits = motion_limits(joints, {});
    const auto turning_s = [&](const HeadAngles& from, const HeadAngles& to) {
      return least_time_s(limits, std::array{from.pan_rad, from.tilt_rad},
                          std::array{to.pan_rad, to.tilt_rad});
    };
    struct First {
      std::size_t direction;
      float worth;
      double time_s;
    };
    std::vector<First> firsts;
    for (std::size_t d = 0; d < directions.size(); ++d) {
      const float worth = directions.worth(d, worths_);
      if (worth <= 0.0F) continue;
      const double turn_s = turning_s(request.at, directions.angles(d));
      firsts.push_back({d, worth, turn_s + kDwell_s});
    }
    const auto better = [](const First& a, const First& b) {
      return a.worth / a.time_s > b.worth / b.time_s;
    };
    std::ranges::sort(firsts, better);
    std::size_t count = 0;  // of those that may be
    for (std::size_t i = 0; i < firsts.size() && count < kFirsts; ++i) {
      if (request.may(directions.angles(firsts[i].direction))) firsts[count++] = firsts[i];
    }
    std::size_t best = 0;
    double most = 0.0;
    std::vector<float> rest;
    for (const First& first : std::span(firsts).first(count)) {
      rest = worths_;
      for (std::size_t k = 0; k < rest.size(); ++k) {
        if (directions.shows(first.direction, k)) rest[k] = 0.0F;
      }
      const HeadAngles& from = directions.angles(first.direction);
      double rate = static_cast<double>(first.worth) / first.time_s;
      for (std::size_t d = 0; d < directions.size(); ++d) {
        const double then_s = turning_s(from, directions.angles(d)) + kDwell_s;
        const auto both = static_cast<double>(first.worth + directions.worth(d, rest));
        rate = std::max(rate, both / (first.time_s + then_s));
      }
      if (rate <= most) continue;
      best = first.direction;
      most = rate;
    }
    return best;
  }

  Options options_;
  LookedAt looked_at_;
  std::vector<Place> places_;
  std::vector<float> worths_;
};

Result<std::unique_ptr<Gaze>> create(const Options& options, const HostContext&) {
  return std::make_unique<Foresight>(options);
}

}  // namespace

SIDESTEP_PLUGIN(Gaze, Options, create, "foresight", "0.1.0",
                "The head looks where most is to be learned a second, two directions ahead")
