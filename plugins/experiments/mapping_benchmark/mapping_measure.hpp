#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/measures/field_accuracy.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/runtime/host.hpp>
#include "frame_feed.hpp"
#include "mapping_settings.hpp"

namespace sidestep {

/// One update: wall times of its stages, and what the process held afterwards.
struct UpdateRecord {
  std::int64_t frame_sequence = 0;
  double integrate_ms = 0.0;
  double field_ms = 0.0;
  double publish_ms = 0.0;
  double latency_ms = 0.0;    ///< From the frame's arrival; beside the stages only in real time.
  double resident_mib = 0.0;  ///< More than before the system was made.

  /// From the frame in hand to the published field that has it.
  [[nodiscard]] double frame_ms() const noexcept { return integrate_ms + field_ms + publish_ms; }
};

/// Result of a system on one clock.
struct ClockRecord {
  std::vector<UpdateRecord> updates;
  std::int64_t bad_frames = 0;  ///< That the mapper could not use.
  std::int64_t dropped = 0;     ///< Real time only: late.
  double duration_s = 0.0;      ///< Real time only: from the first to the last publication.
  FieldAccuracy accuracy;
  int accuracy_checks = 0;
  std::optional<TruthRecord> truth;
};

/// Result of one case.
struct CaseRecord {
  SystemCase what;
  bool is_signed = false;  ///< As the published fields say.
  std::optional<ClockRecord> every_frame;
  std::optional<ClockRecord> real_time;
  std::string error;  ///< Why it could not be measured; empty if it was.
  bool interrupted = false;
};

/// What measuring borrows.
struct MeasureContext {
  Host& host;
  Log& log;
  std::shared_ptr<const RobotModel> robot;
  FrameFeed& feed;
  const MappingBenchmarkSettings& settings;
  std::stop_token stop;
  std::function<void()> updated;  ///< After every frame of the feed, for progress.
};

/// Measures one system on the clocks that the settings ask for, each with a new mapper and field.
/// A system that fails is recorded as such; fails itself only where frames cannot be had.
[[nodiscard]] Result<CaseRecord> measure_case(const SystemCase& what, MeasureContext& context);

/// Memory of this process that is in RAM, in MiB; what was freed is given back first. 0 where the
/// system does not tell.
[[nodiscard]] double resident_mib(bool trim);

}  // namespace sidestep
