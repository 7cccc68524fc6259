#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "node.hpp"
#include "node_messages.hpp"
#include "robot_link.hpp"
#include "ros1_executor.hpp"

namespace sidestep::ros1_executor {

class BaseDrive;

/// What the robot has been told to do: a trajectory, whose time 0 is at a stamp of the run's clock.
/// Kept once it has ended, for the robot is still held there. One thread at a time.
class CommandedMotion {
 public:
  void set(Trajectory trajectory, Stamp start);
  /// It was told nothing, or nothing but to hold.
  void clear() { trajectory_ = {}; }

  [[nodiscard]] bool is_empty() const noexcept { return trajectory_.size() == 0; }
  [[nodiscard]] const Trajectory& trajectory() const noexcept { return trajectory_; }
  [[nodiscard]] Stamp start() const noexcept { return start_; }
  [[nodiscard]] double since_start_s(Stamp now) const noexcept {
    return 1e-9 * static_cast<double>(now.ns - start_.ns);
  }
  /// Until it ends; also before it starts.
  [[nodiscard]] bool is_under_way(Stamp now) const {
    return !is_empty() && since_start_s(now) < trajectory_.duration_s();
  }
  /// Where the robot is told to be at a time: its ends, at rest, beyond them. Nothing where it is
  /// empty.
  [[nodiscard]] std::optional<RobotState> at(Stamp now) const;

 private:
  Trajectory trajectory_;
  Stamp start_;
};

/// How the robot comes to rest from `now` on. Where it was measured within `tolerance` of what it
/// was told (every joint, m or rad), or is not measured: along that path, or straight on from
/// there. Else straight on from what it does. Empty where nothing is known to stop from, and where
/// a joint that moves may not be slowed down. [any]; allocates.
[[nodiscard]] Trajectory stopping(const CommandedMotion& told,
                                  const std::optional<Executor::Measured>& measured,
                                  double tolerance, const MotionLimits& limits, Stamp now);

/// From `from_s` on, as much of a motion as one command holds: `horizon_s` of it and then a stop
/// along its path, or its rest where that is shorter, where it cannot stop in time, or where
/// `horizon_s` is 0. Time 0 is at `from_s`, within [0, duration). [any]; allocates.
[[nodiscard]] Trajectory command_window(const Trajectory& followed, double from_s, double horizon_s,
                                        const MotionLimits& limits);

/// The messages that make controllers follow one trajectory: the same stamp, the same times, each
/// controller its joints. One thread at a time.
class CommandWriter {
 public:
  /// Fails with kConfig for a joint that is neither the robot's nor held, and for one of the
  /// robot's that neither a controller nor `twist` moves.
  [[nodiscard]] static Result<CommandWriter> create(const RobotDescription& robot,
                                                    const Options& options);

  /// The times of a command's points: 0, each 1 / rate, and the end.
  [[nodiscard]] std::vector<double> times(const Trajectory& trajectory) const;

  /// One for each controller, in order: states at those times, whose time 0 is at `stamp`, ROS
  /// time. Held joints stay where they are held; controllers of a head that turn_head() has turned
  /// get an empty message, without joints.
  [[nodiscard]] std::vector<ros_messages::JointTrajectory> write(const Trajectory& trajectory,
                                                                 Stamp stamp) const;
  /// That turn a head from `from` to `to` by one cubic within its limits, and empty ones for all
  /// others; write() leaves these controllers out from then on. Fails, and changes nothing,
  /// with kUnsupported where one of its joints is not held, or moved by a controller that moves
  /// planned joints, too.
  [[nodiscard]] Result<std::vector<ros_messages::JointTrajectory>> turn_head(
      const HeadDescription& head, const HeadAngles& from, const HeadAngles& to, Stamp stamp);
  /// Messages without any state: controllers drop what they follow, and hold.
  [[nodiscard]] std::vector<ros_messages::JointTrajectory> write_hold(Stamp stamp) const;

 private:
  struct Column {
    int joint = -1;     ///< The robot's; -1: held.
    double held = 0.0;  ///< Where.
  };
  struct Controller {
    std::vector<std::string> names;
    std::vector<Column> columns;
    bool turns_head = false;  ///< And nothing else: it has been told where.
  };
  CommandWriter() = default;
  [[nodiscard]] ros_messages::JointTrajectory header_of(const Controller& controller,
                                                        Stamp stamp) const;

  double rate_hz_ = 0.0;
  std::vector<Controller> controllers_;
};

/// Sends controllers, and the drive of the base if there is one, what the robot was told, stretch
/// by stretch; in mode `shadow` nothing. One thread at a time.
class CommandStream {
 public:
  /// `link` outlives this; `drive` may be null.
  CommandStream(const Options& options, MotionLimits limits, CommandWriter writer, RobotLink& link,
                std::unique_ptr<BaseDrive> drive);
  /// The base comes to the end of what it was told before.
  ~CommandStream();

  /// The topics on which nobody listens.
  [[nodiscard]] std::vector<std::string> deaf_topics() const;

  /// Another motion is to be sent, from its beginning.
  void begin();
  /// The next stretch of `told`, where the last command's is used up far enough. `time` is up to
  /// date.
  void send(const CommandedMotion& told, Stamp now, const ros1_node::RunTime& time);
  /// All of a motion that begins at `ros_stamp`, ROS time; nothing of it is left for send().
  void send_whole(const Trajectory& motion, Stamp ros_stamp);
  /// Controllers drop what they follow, and hold.
  void hold(Stamp ros_stamp);
  /// Turns a head, beside all motions. Fails as CommandWriter::turn_head() does.
  [[nodiscard]] Result<void> turn_head(const HeadDescription& head, const HeadAngles& from,
                                       const HeadAngles& to, Stamp ros_stamp);

 private:
  void command(const Trajectory& motion, Stamp ros_stamp);

  static constexpr Stamp kLongAgo{std::numeric_limits<std::int64_t>::min() / 2};

  bool is_shadow_;
  double horizon_s_;
  std::int64_t renewal_ns_;
  MotionLimits limits_;
  CommandWriter writer_;
  RobotLink& link_;
  std::unique_ptr<BaseDrive> drive_;
  Stamp sent_ = kLongAgo;
  bool sent_whole_ = false;
};

}  // namespace sidestep::ros1_executor
