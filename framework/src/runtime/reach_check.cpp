#include "reach_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace sidestep::detail {
namespace {

constexpr double kFar_m = 1e6;          ///< Where what never moves is touched by nothing.
constexpr double kStep_s = 0.05;        ///< Between two states that are looked at.
constexpr double kStanding_mps = 0.15;  ///< Tracks that are slower stand.
constexpr double kBeside_m = 0.1;       ///< What is seen to move so near a track is a part of it.

}  // namespace

ReachCheck::ReachCheck(std::shared_ptr<const RobotModel> robot, MotionLimits limits,
                       const ReplannerSettings& settings)
    : robot_(std::move(robot)),
      limits_(std::move(limits)),
      speed_mps_(settings.obstacle_speed_mps),
      acceleration_mps2_(settings.safety == "ssm" ? std::nullopt
                                                  : settings.obstacle_acceleration_mps2),
      out_of_view_s_(settings.out_of_view_s),
      margin_m_(settings.margin_m),
      fixed_(fixed_spheres(*robot_)),
      counts_standing_(settings.safety == "ssm" || acceleration_mps2_) {
  if (settings.safety == "ssm") {
    speed_mps_ = std::max(speed_mps_, kWalkingSpeed_mps);
    margin_m_ += settings.intrusion_m;
  }
  for (const CollisionSphere& sphere : robot_->description().spheres) {
    largest_m_ = std::max(largest_m_, sphere.radius_m);
  }
}

void ReachCheck::look_at(const MovingObstacles* moving, const Tracks* tracks) {
  movers_.clear();
  has_lost_track_ = tracks != nullptr && !check_tracks(*tracks);
  if (speed_mps_ == 0.0) return;
  const Tracks none;
  if (tracks == nullptr || has_lost_track_) tracks = &none;
  const auto is_tracked = [&](const MovingBall& ball, Stamp seen) {
    const double since_s = tracks->stamp.seconds() - seen.seconds();
    return acceleration_mps2_ && std::ranges::any_of(tracks->tracks, [&](const Track& track) {
             const Eigen::Vector3d& c = ball.centre_m;
             const Eigen::Vector2d then_m = track.position_m - since_s * track.velocity_mps;
             const double sticks_out_m = ball.radius_m - kBeside_m;
             return (c.head<2>() - then_m).norm() + sticks_out_m <= track.radius_m &&
                    c.z() - sticks_out_m >= track.bottom_m && c.z() + sticks_out_m <= track.top_m;
           });
  };
  if (moving != nullptr) {
    for (const MovingBall& ball : moving->balls) {
      const Stamp seen = ball.seen.value_or(moving->stamp);
      const bool is_forgotten = moving->stamp.seconds() - seen.seconds() > out_of_view_s_;
      if (!is_forgotten && !is_tracked(ball, seen)) movers_.push_back({ball, {}, seen});
    }
  }
  for (const Track& track : tracks->tracks) add_track(track, tracks->stamp);
}

/// Balls as far apart as the cylinder is wide cover it.
void ReachCheck::add_track(const Track& track, Stamp seen) {
  if (!counts_standing_ && track.velocity_mps.norm() < kStanding_mps) return;
  std::optional<Eigen::Vector3d> velocity_mps;
  Eigen::Vector2d position_m = track.position_m;
  if (acceleration_mps2_) velocity_mps.emplace(track.velocity_mps.x(), track.velocity_mps.y(), 0.0);
  const double unseen_s = std::max(0.0, seen.seconds() - track.last_seen.seconds());
  if (acceleration_mps2_ || unseen_s <= out_of_view_s_) {
    // Whoever is out of sight may have turned since.
    position_m -= unseen_s * track.velocity_mps;
    seen = std::min(seen, track.last_seen);
  }
  const double height_m = std::max(track.top_m - track.bottom_m, 0.0);
  constexpr double kMost = 100.0;
  const int balls = static_cast<int>(
      std::clamp(std::ceil(0.5 * height_m / std::max(track.radius_m, 0.05)), 1.0, kMost));
  const double half_m = 0.5 * height_m / balls;
  for (int k = 0; k < balls; ++k) {
    const double z_m = track.bottom_m + (2 * k + 1) * half_m;
    movers_.push_back({{{position_m.x(), position_m.y(), z_m}, std::hypot(track.radius_m, half_m)},
                       velocity_mps,
                       seen});
  }
}

/// Within the speed that it may have of where it was, and, where it cannot turn at once, within
/// half its acceleration times the squared time of where it was going; until `kStep_s` later.
std::array<ReachCheck::Reach, 2> ReachCheck::reaches(const Mover& mover, double after_s) const {
  const double end_s = after_s + kStep_s;
  if (!mover.velocity_mps) {
    const Reach reach{mover.ball.centre_m, mover.ball.radius_m + speed_mps_ * end_s};
    return {reach, reach};
  }
  const double now_mps = mover.velocity_mps->norm();
  return {Reach{mover.ball.centre_m, mover.ball.radius_m + std::max(speed_mps_, now_mps) * end_s},
          Reach{mover.ball.centre_m + (after_s + 0.5 * kStep_s) * *mover.velocity_mps,
                mover.ball.radius_m + 0.5 * kStep_s * now_mps +
                    0.5 * *acceleration_mps2_ * end_s * end_s}};
}

/// The motion and then a stop, along the path where that can be, else beside it; nothing where
/// neither can be.
std::optional<Trajectory> ReachCheck::until_rest(const Trajectory& motion, double from_s,
                                                 double brake_s) const {
  brake_s = std::min(brake_s, motion.duration_s());
  Trajectory lead = cut(motion, from_s, std::max(brake_s, from_s + 1e-3));
  auto stop = brake(motion, brake_s, limits_);
  if (!stop) stop = brake_straight(end_state(lead), limits_);
  if (!stop) return std::nullopt;
  return joined(lead, *stop);
}

std::optional<Contingency> ReachCheck::contingency(const Trajectory& motion, double from_s,
                                                   double brake_s) const {
  const auto way = until_rest(motion, from_s, brake_s);
  if (!way) return std::nullopt;
  const int steps = std::max(1, static_cast<int>(std::ceil(way->duration_s() / kStep_s)));
  const auto states = static_cast<std::size_t>(steps) + 1;
  const auto dof = static_cast<std::size_t>(motion.dof);
  const std::size_t spheres = robot_->description().spheres.size();
  Contingency out;
  out.begin_s = from_s;
  out.brake_s = brake_s;
  out.centres_m.resize(states * spheres);
  std::vector<double> q(states * dof);
  for (std::size_t i = 0; i < states; ++i) {
    out.times_s.push_back(way->duration_s() * static_cast<double>(i) / steps);
    way->sample(out.times_s.back(), std::span(q).subspan(i * dof, dof), {});
  }
  Scratch scratch;
  robot_->sphere_centres(q, out.centres_m, scratch);
  for (std::size_t i = 0; i < states; ++i) {
    Eigen::AlignedBox3d& box = out.boxes_m.emplace_back();
    for (std::size_t s = 0; s < spheres; ++s) {
      Eigen::Vector3d& centre_m = out.centres_m[i * spheres + s];
      if (fixed_[s]) {
        centre_m.setConstant(kFar_m);
      } else {
        box.extend(centre_m);
      }
    }
  }
  return out;
}

std::optional<std::string> ReachCheck::first_reach(const Contingency& contingency, Stamp begin,
                                                   Stamp now) const {
  if (!sees_anything()) return std::nullopt;
  if (has_lost_track_) return "what is tracked makes no sense";
  const std::vector<CollisionSphere>& spheres = robot_->description().spheres;
  const double begin_s = begin.seconds() - now.seconds();
  for (std::size_t i = 0; i < contingency.times_s.size(); ++i) {
    const double in_s = begin_s + contingency.times_s[i];
    const bool is_last = i + 1 == contingency.times_s.size();
    if (in_s + kStep_s < 0.0 && !is_last) continue;  // in the past
    const Eigen::Vector3d* centres_m = contingency.centres_m.data() + i * spheres.size();
    for (const Mover& mover : movers_) {
      const double seen_s = std::min(0.0, mover.seen.seconds() - now.seconds());
      const auto [near, ahead] = reaches(mover, std::max(in_s, 0.0) - seen_s);
      const auto is_apart = [&](const Reach& reach) {
        return contingency.boxes_m[i].exteriorDistance(reach.centre_m) >=
               largest_m_ + margin_m_ + reach.radius_m;
      };
      if (is_apart(near) || is_apart(ahead)) continue;
      for (std::size_t s = 0; s < spheres.size(); ++s) {
        const auto touches = [&](const Reach& reach) {
          const double apart_m = spheres[s].radius_m + margin_m_ + reach.radius_m;
          return (centres_m[s] - reach.centre_m).squaredNorm() < apart_m * apart_m;
        };
        if (!touches(near) || !touches(ahead)) continue;
        const auto link = static_cast<std::size_t>(spheres[s].link);
        const Eigen::Vector3d& at_m = mover.ball.centre_m;
        return format("what moves at (%.2f, %.2f, %.2f) m could reach ", at_m.x(), at_m.y(),
                      at_m.z()) +
               robot_->description().links[link].name + format(" in %.2g s", std::max(in_s, 0.0));
      }
    }
  }
  return std::nullopt;
}

std::optional<std::string> ReachCheck::first_reach(const Trajectory& motion, double from_s,
                                                   double brake_s, Stamp now) const {
  if (!sees_anything()) return std::nullopt;
  const auto way = contingency(motion, from_s, brake_s);
  if (!way) return "something moves, and no stop can be found";
  return first_reach(*way, now, now);
}

}  // namespace sidestep::detail
