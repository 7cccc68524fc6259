#pragma once

#include <optional>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>

namespace sidestep::ros1_node {

/// The run's clock beside ROS's: which instant of the one is which of the other. While the run's
/// clock stands at its zero, as before a run begins, they drift apart freely; from then on the
/// distance between them follows what both say, and a change beyond the tolerance is a jump. One
/// thread at a time.
class RunTime {
 public:
  explicit RunTime(double jump_tolerance_s) : jump_tolerance_s_(jump_tolerance_s) {}

  /// What both clocks say at one instant. Fails with kInternal, naming both and how far each went,
  /// where one has jumped; and from then on for good.
  [[nodiscard]] Result<void> update(Stamp run, Stamp ros);

  /// After the first update().
  [[nodiscard]] Stamp to_run(Stamp ros) const noexcept { return {ros.ns + offset_ns_}; }
  [[nodiscard]] Stamp to_ros(Stamp run) const noexcept { return {run.ns - offset_ns_}; }

 private:
  struct Reading {
    Stamp run;
    Stamp ros;
  };
  double jump_tolerance_s_;
  std::int64_t offset_ns_ = 0;  ///< Run's minus ROS's.
  std::optional<Reading> last_;
  std::optional<Error> jump_;
};

/// Reads both clocks, close together, and updates. Fails likewise, and with kUnsupported where ROS
/// time stands at zero: its parameter use_sim_time is set, and nobody publishes /clock.
[[nodiscard]] Result<void> update(RunTime& time, const Clock& run);

}  // namespace sidestep::ros1_node
