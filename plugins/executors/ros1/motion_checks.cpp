#include "motion_checks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <sidestep/core/index.hpp>

namespace sidestep::ros1_executor {
namespace {

/// Between two support states, over a share f of [0, 1]: q0 + h (v0 f + b f^2 / 2 + c f^3 / 3), and
/// so at the velocity v0 + b f + c f^2.
struct Stretch {
  double q0, h, v0, b, c;

  [[nodiscard]] double position(double f) const {
    return q0 + h * f * (v0 + f * (0.5 * b + f * c / 3.0));
  }
  [[nodiscard]] double velocity(double f) const { return v0 + f * (b + f * c); }
};

Stretch stretch(const Trajectory& trajectory, int state, int joint) {
  const auto i = static_cast<std::size_t>(state);
  const auto j = static_cast<std::size_t>(joint);
  const double h = trajectory.times_s[i + 1] - trajectory.times_s[i];
  const double v0 = trajectory.qdot(state)[j];
  const double v1 = trajectory.qdot(state + 1)[j];
  const double mean = (trajectory.q(state + 1)[j] - trajectory.q(state)[j]) / h;
  const double c = 3.0 * (v0 + v1 - 2.0 * mean);
  return {trajectory.q(state)[j], h, v0, v1 - v0 - c, c};
}

/// Where the velocity is zero; NaN for none.
std::array<double, 2> turns(const Stretch& s) {
  const double root = std::sqrt(s.b * s.b - 4.0 * s.c * s.v0);
  // Neither loses digits where c is small.
  const double sum = -0.5 * (s.b + std::copysign(root, s.b));
  return {sum / s.c, s.v0 / sum};
}

std::string number(double value) { return format("%g", value); }

}  // namespace

JointExtent extent_of(const Trajectory& trajectory, int joint) {
  const double begin = trajectory.q(0)[idx(joint)];
  JointExtent extent{begin, begin, std::abs(trajectory.qdot(0)[idx(joint)]), 0.0};
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    const Stretch s = stretch(trajectory, i, joint);
    const auto [one, other] = turns(s);
    for (const double f : {1.0, one, other}) {
      if (!(f >= 0.0 && f <= 1.0)) continue;
      extent.lowest = std::min(extent.lowest, s.position(f));
      extent.highest = std::max(extent.highest, s.position(f));
    }
    for (const double f : {0.0, 1.0, -0.5 * s.b / s.c}) {
      if (!(f >= 0.0 && f <= 1.0) || std::abs(s.velocity(f)) <= extent.fastest) continue;
      extent.fastest = std::abs(s.velocity(f));
      extent.fastest_at_s = trajectory.times_s[idx(i)];
    }
  }
  return extent;
}

Result<void> check_motion(const Trajectory& trajectory, const RobotDescription& robot,
                          double velocity_tolerance) {
  if (auto valid = trajectory.validate(); !valid) {
    return invalid(valid.error().message);
  }
  if (trajectory.size() == 0) {
    return invalid("the trajectory has no states");
  }
  if (trajectory.dof != robot.dof()) {
    return invalid("the trajectory has " + std::to_string(trajectory.dof) + " joints, robot '" +
                   robot.name + "' has " + std::to_string(robot.dof()));
  }
  for (int j = 0; j < robot.dof(); ++j) {
    const Joint& joint = robot.joints[idx(j)];
    const JointExtent extent = extent_of(trajectory, j);
    if (extent.fastest <= joint.max_velocity * (1.0 + velocity_tolerance)) continue;
    return invalid("the trajectory moves joint '" + joint.name + "' at " + number(extent.fastest) +
                   " per s after " + number(extent.fastest_at_s) + " s, its limit is " +
                   number(joint.max_velocity));
  }
  return {};
}

Result<void> check_start(const Trajectory& trajectory, double from_s,
                         const std::optional<RobotState>& expected, const RobotDescription& robot,
                         double tolerance) {
  if (!expected) return refuse("where the robot is is not known");
  std::vector<double> begin(static_cast<std::size_t>(trajectory.dof));
  trajectory.sample(from_s, begin, {});
  for (std::size_t j = 0; j < begin.size(); ++j) {
    const double there = expected->q[static_cast<Eigen::Index>(j)];
    if (std::abs(begin[j] - there) <= tolerance) continue;
    return refuse("the trajectory begins with joint '" + robot.joints[j].name + "' at " +
                  figure(begin[j]) + ", it will be at " + figure(there));
  }
  return {};
}

Result<void> check_box(const Trajectory& trajectory, const RobotDescription& robot,
                       const Options& options) {
  if (!options.keep_in) return {};
  const std::string* const names[] = {&options.odometry->x_joint, &options.odometry->y_joint};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const JointExtent extent = extent_of(trajectory, *robot.joint_index(*names[axis]));
    const double lower = options.keep_in->lower_m[axis];
    const double upper = options.keep_in->upper_m[axis];
    if (extent.lowest >= lower && extent.highest <= upper) continue;
    return refuse("the trajectory takes the base out of keep_in: " + *names[axis] + " from " +
                      figure(extent.lowest) + " to " + figure(extent.highest) + " m, the box is " +
                      figure(lower) + " to " + figure(upper) + " m",
                  "another goal, or a larger box");
  }
  return {};
}

Result<void> Confirmation::check(const Trajectory& trajectory, bool moves, RobotLink& link) {
  if (!is_asked_ || moves) return {};
  const bool was_shown = proposed_.size() > 0;
  // A yes from before there was anything to say yes to is none.
  const bool is_confirmed = link.take_confirmation() && was_shown;
  if (is_confirmed) {
    log_.info("executor ros1: the operator confirmed the motion");
    proposed_ = {};
    return {};
  }
  if (!was_shown) {
    log_.warn("executor ros1: a motion of " + figure(trajectory.duration_s()) +
              " s waits for a yes on " + topic_);
  }
  proposed_ = trajectory;
  return refuse("the motion waits for an operator's yes on " + topic_,
                "rostopic pub -1 " + topic_ + " std_msgs/Bool true");
}

}  // namespace sidestep::ros1_executor
