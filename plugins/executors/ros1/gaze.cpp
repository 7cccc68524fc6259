#include "gaze.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sidestep::ros1_executor {
namespace {

/// A base that goes no farther than this is not going anywhere.
constexpr double kHere_m = 0.1;

}  // namespace

Result<Gaze> Gaze::create(const RobotDescription& robot, const OdometryOptions& base,
                          const LookOptions& look) {
  const auto x = robot.joint_index(base.x_joint);
  const auto y = robot.joint_index(base.y_joint);
  const auto yaw = robot.joint_index(base.yaw_joint);
  if (x && y && yaw) return Gaze(look, *x, *y, *yaw);
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' lacks a joint of its base",
              "executor.odometry");
}

double Gaze::wanted(const Trajectory& plan, double at_s) const {
  std::vector<double> here(static_cast<std::size_t>(plan.dof));
  std::vector<double> there(here.size());
  plan.sample(at_s, here, {});
  plan.sample(at_s + look_.ahead_s, there, {});
  const auto of = [](const std::vector<double>& q, int joint) {
    return q[static_cast<std::size_t>(joint)];
  };
  const double dx = of(there, x_) - of(here, x_);
  const double dy = of(there, y_) - of(here, y_);
  if (std::hypot(dx, dy) < kHere_m) return std::clamp(0.0, look_.lower_rad, look_.upper_rad);
  const double bearing =
      std::remainder(std::atan2(dy, dx) - of(here, yaw_), 2.0 * std::numbers::pi);
  return std::clamp(bearing, look_.lower_rad, look_.upper_rad);
}

std::vector<double> Gaze::pans(const Trajectory& plan, double from_s,
                               std::span<const double> times_s, double pan_rad) const {
  std::vector<double> list;
  double before_s = times_s.empty() ? 0.0 : times_s.front();
  for (const double time_s : times_s) {
    const double most = look_.speed_radps * (time_s - before_s);
    pan_rad += std::clamp(wanted(plan, from_s + time_s) - pan_rad, -most, most);
    list.push_back(pan_rad);
    before_s = time_s;
  }
  return list;
}

}  // namespace sidestep::ros1_executor
