#include "command_stream.hpp"

#include <algorithm>
#include <utility>
#include <vector>

namespace sidestep::ros1_executor {

CommandStream::CommandStream(const Options& options, MotionLimits limits, CommandWriter writer,
                             std::optional<Gaze> gaze, RobotLink& link)
    : is_shadow_(options.mode == "shadow"),
      horizon_s_(options.command_horizon_s),
      renewal_ns_(Stamp::from_seconds(options.command_renewal_s).ns),
      pan_joint_(options.look ? options.look->pan_joint : ""),
      limits_(std::move(limits)),
      writer_(std::move(writer)),
      gaze_(std::move(gaze)),
      link_(link) {}

void CommandStream::begin() {
  sent_whole_ = false;
  sent_ = kLongAgo;
}

void CommandStream::send(const ToldMotion& told, Stamp now, const ros1_node::RunTime& time) {
  if (is_shadow_ || sent_whole_ || now.ns - sent_.ns < renewal_ns_) return;
  const Stamp from = std::max(now, told.start());
  const double from_s = told.since_start_s(from), duration_s = told.trajectory().duration_s();
  constexpr double kShortest_s = 1e-3;
  if (from_s + kShortest_s >= duration_s) return;
  sent_whole_ = horizon_s_ <= 0.0 || from_s + horizon_s_ >= duration_s;
  command(command_window(told.trajectory(), from_s, horizon_s_, limits_), told.trajectory(), from_s,
          time.to_ros(from));
  sent_ = now;
}

void CommandStream::send_whole(const Trajectory& motion, Stamp ros_stamp) {
  if (!is_shadow_) command(motion, motion, 0.0, ros_stamp);
  sent_whole_ = true;
}

void CommandStream::hold(Stamp ros_stamp) {
  if (!is_shadow_) link_.command(writer_.write_hold(ros_stamp));
}

/// A window of a plan that begins at `from_s` of it.
void CommandStream::command(const Trajectory& window, const Trajectory& plan, double from_s,
                            Stamp ros_stamp) {
  std::vector<double> pans;
  if (gaze_) {
    const double pan_rad = link_.feed().held_position(pan_joint_).value_or(0.0);
    pans = gaze_->pans(plan, from_s, writer_.times(window), pan_rad);
  }
  link_.command(writer_.write(window, ros_stamp, pans));
}

}  // namespace sidestep::ros1_executor
