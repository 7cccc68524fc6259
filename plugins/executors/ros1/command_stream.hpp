#pragma once

#include <limits>
#include <optional>

#include <sidestep/trajectory/motion_limits.hpp>

#include "commands.hpp"
#include "gaze.hpp"
#include "robot_link.hpp"
#include "run_time.hpp"
#include "told_motion.hpp"

namespace sidestep::ros1_executor {

/// Sends controllers what the robot was told, stretch by stretch; in mode `shadow` nothing. One
/// thread at a time.
class CommandStream {
 public:
  /// `link` outlives this.
  CommandStream(const Options& options, MotionLimits limits, CommandWriter writer,
                std::optional<Gaze> gaze, RobotLink& link);

  /// Another motion is to be sent, from its beginning.
  void begin();
  /// The next stretch of `told`, where the last command's is used up far enough. `time` is up to
  /// date.
  void send(const ToldMotion& told, Stamp now, const ros1_node::RunTime& time);
  /// All of a motion that begins at `ros_stamp`, ROS time; nothing of it is left for send().
  void send_whole(const Trajectory& motion, Stamp ros_stamp);
  /// Controllers drop what they follow, and hold.
  void hold(Stamp ros_stamp);

 private:
  void command(const Trajectory& window, const Trajectory& plan, double from_s, Stamp ros_stamp);

  static constexpr Stamp kLongAgo{std::numeric_limits<std::int64_t>::min() / 2};

  bool is_shadow_;
  double horizon_s_;
  std::int64_t renewal_ns_;
  std::string pan_joint_;  ///< Where there is a gaze.
  MotionLimits limits_;
  CommandWriter writer_;
  std::optional<Gaze> gaze_;
  RobotLink& link_;
  Stamp sent_ = kLongAgo;
  bool sent_whole_ = false;
};

}  // namespace sidestep::ros1_executor
