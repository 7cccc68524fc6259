#include "start_state.hpp"

#include <string>
#include <vector>

namespace sidestep::simulated {
namespace {

constexpr double kRounding = 1e-9;

Error unknown_joint(const Node& value, const std::string& name, const RobotDescription& robot) {
  std::vector<std::string> names;
  std::string list;
  for (const Joint& joint : robot.joints) {
    names.push_back(joint.name);
    list += (list.empty() ? "" : ", ") + joint.name;
  }
  return value.error("robot '" + robot.name + "' has no joint '" + name + "'",
                     did_you_mean(name, names, "its joints: " + list));
}

}  // namespace

Result<Eigen::VectorXd> read_start(const Node& start, const RobotDescription& robot) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  if (!start.is_null() && !start.is_map()) {
    return tl::make_unexpected(
        start.error("'start' must be a map of joint names to positions, found " + start.kind()));
  }
  for (const auto& [name, mark, value] : start.entries()) {
    const auto joint = robot.joint_index(name);
    if (!joint) return tl::make_unexpected(unknown_joint(value, name, robot));
    q[*joint] = SIDESTEP_TRY(value.as_double());
  }
  for (int j = 0; j < robot.dof(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (q[j] >= joint.lower - kRounding && q[j] <= joint.upper + kRounding) continue;
    const Node* given = start.find(joint.name);
    return tl::make_unexpected((given != nullptr ? *given : start)
                                   .error("joint '" + joint.name + "' cannot start at " +
                                              std::to_string(q[j]) + ", outside its limits " +
                                              std::to_string(joint.lower) + " to " +
                                              std::to_string(joint.upper),
                                          given != nullptr ? "" : "give it a place in 'start'"));
  }
  return q;
}

}  // namespace sidestep::simulated
