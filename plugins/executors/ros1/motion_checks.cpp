#include "motion_checks.hpp"

#include <cmath>
#include <vector>

#include "figures.hpp"
#include "joint_extent.hpp"
#include "refusals.hpp"

namespace sidestep::ros1_executor {

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
