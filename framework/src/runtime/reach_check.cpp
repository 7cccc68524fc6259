#include "reach_check.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace sidestep::detail {
namespace {

constexpr double kStep_s = 0.1;  ///< Between two states that are looked at.

}  // namespace

ReachCheck::ReachCheck(std::shared_ptr<const RobotModel> robot, MotionLimits limits,
                       double speed_mps, double margin_m)
    : robot_(std::move(robot)),
      limits_(std::move(limits)),
      speed_mps_(speed_mps),
      margin_m_(margin_m) {}

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

std::optional<std::string> ReachCheck::first_reach(const Trajectory& motion, double from_s,
                                                   double brake_s, Stamp now) const {
  if (speed_mps_ <= 0.0 || moving_ == nullptr || moving_->balls.empty()) return std::nullopt;
  const auto contingency = until_rest(motion, from_s, brake_s);
  if (!contingency) return "something moves, and no stop can be found";
  const double age_s = std::max(0.0, now.seconds() - moving_->stamp.seconds());
  const std::vector<CollisionSphere>& spheres = robot_->description().spheres;
  std::vector<Eigen::Vector3d> centres(spheres.size());
  double largest_m = 0.0;
  for (const CollisionSphere& sphere : spheres) largest_m = std::max(largest_m, sphere.radius_m);
  std::vector<double> q(static_cast<std::size_t>(motion.dof));
  Scratch scratch;
  const int steps = std::max(1, static_cast<int>(std::ceil(contingency->duration_s() / kStep_s)));
  for (int i = 0; i <= steps; ++i) {
    const double time_s = contingency->duration_s() * i / steps;
    contingency->sample(time_s, q, {});
    robot_->sphere_centres(q, centres, scratch);
    // What moves is taken to be where it can be at the end of the step.
    const double grown_m = margin_m_ + speed_mps_ * (age_s + time_s + kStep_s);
    Eigen::AlignedBox3d around;
    for (const Eigen::Vector3d& centre : centres) around.extend(centre);
    for (const MovingBall& ball : moving_->balls) {
      if (around.exteriorDistance(ball.centre_m) >= largest_m + ball.radius_m + grown_m) continue;
      for (std::size_t s = 0; s < spheres.size(); ++s) {
        const double apart_m = spheres[s].radius_m + ball.radius_m + grown_m;
        if ((centres[s] - ball.centre_m).squaredNorm() >= apart_m * apart_m) continue;
        const auto link = static_cast<std::size_t>(spheres[s].link);
        char text[160];
        std::snprintf(text, sizeof text,
                      "what moves at (%.2f, %.2f, %.2f) m could reach %s in %.2g s",
                      ball.centre_m.x(), ball.centre_m.y(), ball.centre_m.z(),
                      robot_->description().links[link].name.c_str(), time_s);
        return text;
      }
    }
  }
  return std::nullopt;
}

}  // namespace sidestep::detail
