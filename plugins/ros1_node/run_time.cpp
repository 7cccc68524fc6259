#include "run_time.hpp"

#include <cmath>
#include <cstdio>
#include <string>

#include <ros/time.h>

#include "conversions.hpp"

namespace sidestep::ros1_node {
namespace {

std::string seconds_text(std::int64_t ns) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", 1e-9 * static_cast<double>(ns));
  return text;
}

}  // namespace

Result<void> RunTime::update(Stamp run, Stamp ros) {
  if (jump_) return tl::make_unexpected(*jump_);
  const std::int64_t offset_ns = run.ns - ros.ns;
  const bool was_standing = !last_ || last_->run.ns <= 0;
  const auto tolerance_ns = Stamp::from_seconds(jump_tolerance_s_).ns;
  if (!was_standing && std::abs(offset_ns - offset_ns_) > tolerance_ns) {
    jump_ =
        Error{ErrorCode::kInternal,
              "ROS time jumped against the run's clock: it went on by " +
                  seconds_text(ros.ns - last_->ros.ns) + " to " + seconds_text(ros.ns) +
                  " while the run's clock went on by " + seconds_text(run.ns - last_->run.ns) +
                  " to " + seconds_text(run.ns),
              "clock", "let the machines' clocks settle before a run (chrony, not steps)", nullptr};
    return tl::make_unexpected(*jump_);
  }
  offset_ns_ = offset_ns;
  last_ = Reading{run, ros};
  return {};
}

Result<void> update(RunTime& time, const Clock& run) {
  constexpr int kTries = 3;
  constexpr std::int64_t kClose_ns = 200'000;
  Stamp middle, ros;
  for (int i = 0; i < kTries; ++i) {
    const Stamp before = run.now();
    ros = ros_messages::to_stamp(::ros::Time::now());
    const Stamp after = run.now();
    middle = {before.ns + (after.ns - before.ns) / 2};
    if (after.ns - before.ns <= kClose_ns) break;
  }
  if (ros.ns == 0) {
    return fail(ErrorCode::kUnsupported,
                "ROS time stands at zero: /use_sim_time is set, and nobody publishes /clock",
                "clock", "rosparam set /use_sim_time false");
  }
  return time.update(middle, ros);
}

}  // namespace sidestep::ros1_node
