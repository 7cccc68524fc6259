#include "reach_check.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace sidestep::detail {
namespace {

constexpr double kStep_s = 0.1;         ///< Between two states that are looked at.
constexpr double kStanding_mps = 0.15;  ///< Tracks that are slower stand.

}  // namespace

ReachCheck::ReachCheck(std::shared_ptr<const RobotModel> robot, MotionLimits limits,
                       const ReplannerSettings& settings)
    : robot_(std::move(robot)),
      limits_(std::move(limits)),
      speed_mps_(settings.obstacle_speed_mps),
      margin_m_(settings.margin_m),
      counts_standing_(settings.safety == "ssm") {
  if (counts_standing_) {
    speed_mps_ = std::max(speed_mps_, kWalkingSpeed_mps);
    margin_m_ += settings.intrusion_m;
  }
  for (const CollisionSphere& sphere : robot_->description().spheres) {
    largest_m_ = std::max(largest_m_, sphere.radius_m);
  }
}

void ReachCheck::look_at(std::shared_ptr<const MovingObstacles> moving, const Tracks* tracks) {
  moving_ = std::move(moving);
  has_lost_track_ = tracks != nullptr && !check_tracks(*tracks);
  if (tracks == nullptr || speed_mps_ == 0.0 || has_lost_track_) return;
  auto all = moving_ ? std::make_shared<MovingObstacles>(*moving_)
                     : std::make_shared<MovingObstacles>(MovingObstacles{{}, tracks->stamp});
  for (const Track& track : tracks->tracks) {
    if (!counts_standing_ && track.velocity_mps.norm() < kStanding_mps) continue;
    // Balls as far apart as the cylinder is wide cover it.
    const double height_m = std::max(track.top_m - track.bottom_m, 0.0);
    constexpr double kMost = 100.0;
    const int balls = static_cast<int>(
        std::clamp(std::ceil(0.5 * height_m / std::max(track.radius_m, 0.05)), 1.0, kMost));
    const double half_m = 0.5 * height_m / balls;
    for (int k = 0; k < balls; ++k) {
      const double z_m = track.bottom_m + (2 * k + 1) * half_m;
      all->balls.push_back(
          {{track.position_m.x(), track.position_m.y(), z_m}, std::hypot(track.radius_m, half_m)});
    }
  }
  moving_ = std::move(all);
}

/// The motion and then a stop, along the path where that can be, else beside it; nothing where
/// neither can be.
std::optional<Trajectory> ReachCheck::until_rest(const Trajectory& motion, double from_s,
                                                 double brake_s) const {
  brake_s = std::min(brake_s, motion.duration_s());
  Trajectory lead = cut(motion, from_s, std::max(brake_s, from_s + 1e-3));
  auto stop = brake(motion, brake_s, limits_);
  if (!stop) {
    const int last = lead.size() - 1;
    const auto row = [&](std::span<const double> values) {
      return Eigen::Map<const Eigen::VectorXd>(values.data(), lead.dof);
    };
    stop = brake_straight({row(lead.q(last)), row(lead.qdot(last))}, limits_);
  }
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
    for (std::size_t s = 0; s < spheres; ++s) box.extend(out.centres_m[i * spheres + s]);
  }
  return out;
}

std::optional<std::string> ReachCheck::first_reach(const Contingency& contingency, Stamp begin,
                                                   Stamp now) const {
  if (!sees_anything()) return std::nullopt;
  if (has_lost_track_) return "what is tracked makes no sense";
  const std::vector<CollisionSphere>& spheres = robot_->description().spheres;
  const double begin_s = begin.seconds() - now.seconds();
  const double seen_s = std::min(0.0, moving_->stamp.seconds() - now.seconds());
  for (std::size_t i = 0; i < contingency.times_s.size(); ++i) {
    const double in_s = begin_s + contingency.times_s[i];
    const bool is_last = i + 1 == contingency.times_s.size();
    if (in_s + kStep_s < 0.0 && !is_last) continue;  // in the past
    // What moves is taken to be where it can be at the end of the step.
    const double grown_m = margin_m_ + speed_mps_ * (std::max(in_s, 0.0) - seen_s + kStep_s);
    const Eigen::Vector3d* centres_m = contingency.centres_m.data() + i * spheres.size();
    for (const MovingBall& ball : moving_->balls) {
      const double near_m = largest_m_ + ball.radius_m + grown_m;
      if (contingency.boxes_m[i].exteriorDistance(ball.centre_m) >= near_m) continue;
      for (std::size_t s = 0; s < spheres.size(); ++s) {
        const double apart_m = spheres[s].radius_m + ball.radius_m + grown_m;
        if ((centres_m[s] - ball.centre_m).squaredNorm() >= apart_m * apart_m) continue;
        const auto link = static_cast<std::size_t>(spheres[s].link);
        return format("what moves at (%.2f, %.2f, %.2f) m could reach ", ball.centre_m.x(),
                      ball.centre_m.y(), ball.centre_m.z()) +
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
