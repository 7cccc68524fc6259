#pragma once

#include <functional>

#include "inputs.hpp"

namespace sidestep {

/// What a file says of a motion, in the order of the robot's joints.
struct MotionSamples {
  /// Position, velocity and acceleration of each joint.
  using State = std::vector<std::array<double, 3>>;
  std::vector<double> times_s;  ///< From the first one on.
  std::vector<State> states;
  double first_s = 0.0;
  bool has_times = true;
  bool has_velocities = false;
  bool has_accelerations = false;

  /// False where time does not go on.
  [[nodiscard]] bool add(double time_s, State state);
};

/// One message as YAML: what `topic echo` prints ends with "---". Fails with kConfig or kIo.
[[nodiscard]] Result<Node> read_message(const std::filesystem::path& file);

/// Of a RobotTrajectory, DisplayTrajectory or JointTrajectory as YAML.
[[nodiscard]] Result<MotionSamples> read_moveit_motion(const std::filesystem::path& file,
                                                       const RobotDescription& robot);

[[nodiscard]] inline std::string listed_joints(const RobotDescription& robot) {
  std::string names;
  for (const Joint& joint : robot.joints) names += (names.empty() ? "" : ",") + joint.name;
  return names;
}
[[nodiscard]] inline std::string no_such_joint(const RobotDescription& robot,
                                               const std::string& name) {
  return "robot '" + robot.name + "' moves no joint '" + name + "'";
}
[[nodiscard]] inline std::string hint_of_joints(const RobotDescription& robot) {
  return "it moves " + listed_joints(robot) + "; its profile or --fixed holds the others";
}
/// What to do where a motion leaves a joint out.
[[nodiscard]] inline std::string hint_to_hold(const std::string& joint) {
  return "where it does not move, say where it stays: --fixed " + joint + "=VALUE";
}

/// Where in a robot's joints those with these names are: all of them, each once. `where`: a name
/// stands, by its number; all of them, without.
[[nodiscard]] Result<std::vector<std::size_t>> joint_order(
    const std::vector<std::string>& names, const RobotDescription& robot,
    const std::function<std::string(std::optional<std::size_t>)>& where);

/// Of rows of positions, in a .npy of NumPy or a path that OMPL has printed.
[[nodiscard]] Result<MotionSamples> read_rows(const std::filesystem::path& file,
                                              const RobotDescription& robot,
                                              const MotionFormat& format);

struct NamedSamples {
  std::string name;
  MotionSamples samples;
};
/// The trajectories of a recorded run.
[[nodiscard]] Result<std::vector<NamedSamples>> read_recorded_motions(
    const std::filesystem::path& file, const RobotDescription& robot);
/// The last map of a recorded run.
[[nodiscard]] Result<Swarm> read_recorded_map(const std::filesystem::path& file);

}  // namespace sidestep
