#pragma once

#include "certify.hpp"

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

/// Of a RobotTrajectory, DisplayTrajectory or JointTrajectory as YAML.
[[nodiscard]] Result<MotionSamples> read_moveit_motion(const std::filesystem::path& file,
                                                       const RobotDescription& robot);

}  // namespace sidestep
