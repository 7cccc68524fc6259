#pragma once

#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "node_messages.hpp"
#include "options.hpp"

namespace sidestep::ros1_executor {

/// From `from_s` on, as much of a motion as one command holds: `horizon_s` of it and then a stop
/// along its path, or its rest where that is shorter, where it cannot stop in time, or where
/// `horizon_s` is 0. Time 0 is at `from_s`, within [0, duration). [any]; allocates.
[[nodiscard]] Trajectory command_window(const Trajectory& followed, double from_s, double horizon_s,
                                        const MotionLimits& limits);

/// The messages that make controllers follow one trajectory: the same stamp, the same times, each
/// controller its joints. Immutable; [any] thread.
class CommandWriter {
 public:
  /// Fails with kConfig for a joint that is neither the robot's nor held, and for one of the
  /// robot's that no controller moves.
  [[nodiscard]] static Result<CommandWriter> create(const RobotDescription& robot,
                                                    const Options& options);

  /// The times of a command's points: 0, each 1 / rate, and the end.
  [[nodiscard]] std::vector<double> times(const Trajectory& trajectory) const;

  /// One for each controller, in order: states at those times, whose time 0 is at `stamp`, ROS
  /// time. Held joints stay where they are held, but for `look.pan_joint`, which is at `pans` if
  /// that is not empty.
  [[nodiscard]] std::vector<ros_messages::JointTrajectory> write(
      const Trajectory& trajectory, Stamp stamp, const std::vector<double>& pans = {}) const;
  /// Messages without any state: controllers drop what they follow, and hold.
  [[nodiscard]] std::vector<ros_messages::JointTrajectory> write_hold(Stamp stamp) const;

 private:
  struct Column {
    int joint = -1;     ///< The robot's; -1: held.
    double held = 0.0;  ///< Where.
    bool pans = false;  ///< It is `look.pan_joint`.
  };
  struct Controller {
    std::vector<std::string> names;
    std::vector<Column> columns;
  };
  CommandWriter() = default;
  [[nodiscard]] ros_messages::JointTrajectory header_of(const Controller& controller,
                                                        Stamp stamp) const;

  double rate_hz_ = 0.0;
  std::vector<Controller> controllers_;
};

}  // namespace sidestep::ros1_executor
