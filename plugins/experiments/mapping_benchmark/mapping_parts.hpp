#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/measures/field_accuracy.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/sensing/source.hpp>

namespace sidestep {

// Settings.

/// Resolutions that differ by less are the same.
inline constexpr double kSameResolution = 1e-9;

/// One entry of `experiment.systems`: a mapper and a field, as the configuration has them.
struct SystemEntry {
  std::string name;
  Node mapper;
  Node field;
  Node is_signed;  ///< true, false or a list of both; nothing: as the field is by itself.
  std::string published;

  static Parameters<SystemEntry> parameters();
};

/// One entry of `experiment.published`: what somebody printed of a system.
struct PublishedEntry {
  std::string name;
  bool is_signed = false;
  std::vector<double> resolutions_m;
  std::vector<double> frame_ms;

  static Parameters<PublishedEntry> parameters();
};

/// `experiment.expect`: what every system must reach for the run to be a success.
struct ExpectSettings {
  std::optional<double> max_error_m;
  std::optional<double> collision_recall;
  std::optional<double> appear_frames;
  std::optional<double> gone_frames;
  std::optional<double> ghost_vox;

  static Parameters<ExpectSettings> parameters();
};

/// The `experiment` block of a mapping benchmark.
struct MappingBenchmarkSettings : ExperimentSettings {
  std::vector<SystemEntry> systems;
  std::vector<double> resolutions_m;
  Eigen::Vector3d origin_m{-4.0, -4.0, -0.1};
  Eigen::Vector3d extent_m{8.0, 8.0, 3.2};
  double max_distance_m = 0.8;
  std::int64_t frames = 0;
  int stride = 1;
  int frames_in_memory = 400;
  std::string clock = "every_frame";
  std::int64_t accuracy_every = 100;
  std::string reference;
  std::string published_as = "published";
  std::vector<PublishedEntry> published;
  TruthSettings truth;
  ExpectSettings expect;

  static Parameters<MappingBenchmarkSettings> parameters();

  [[nodiscard]] bool on_every_frame() const { return clock != "real_time"; }
  [[nodiscard]] bool in_real_time() const { return clock != "every_frame"; }
};

/// One system at one resolution: what there is to measure.
struct SystemCase {
  std::string name;
  std::string mapper;  ///< Name of the plugin.
  std::string field;
  std::optional<bool> is_signed;  ///< As asked for; nothing: whatever the field is.
  bool unknown_occupied = false;  ///< What the field takes unseen voxels for.
  double resolution_m = 0.0;
  std::optional<double> published_ms;
  Node mapper_block;  ///< With everything that the experiment sets filled in.
  Node field_block;

  /// For people; `has_sign`: its field is signed.
  [[nodiscard]] std::string label(bool has_sign) const {
    return name + (has_sign ? ", signed" : "") + format(" at %g m", resolution_m);
  }
};

/// The cases of an `experiment` block that fits its schema: by system, then signed or not, then
/// resolution. Appends every mistake in it, those in the systems' plugin blocks included, at its
/// position. The experiment sets `resolution_m`, `size_vox` and `origin_m` of mappers and
/// `max_distance_m` and `signed` of fields, whatever the plugin.
[[nodiscard]] std::vector<SystemCase> read_cases(const Node& experiment, Host& host,
                                                 std::vector<Error>& errors);

// Measuring.

/// The frames of a source, decoded ahead of time, again and again from the first. A sequence that
/// fits into `in_memory` frames is read once and kept; a longer one is read again at every
/// rewind(), a memory full at a time, so that reading never falls between two steps that are
/// timed. [mapping]
class FrameFeed {
 public:
  /// Makes the source, with everything random in it as it was at the first call.
  using MakeSource = std::function<Result<PluginPtr<Source>>()>;
  struct Limits {
    std::int64_t frames = 0;  ///< 0: all.
    int stride = 1;           ///< Every n-th frame of the source.
    int in_memory = 1;
  };

  FrameFeed(MakeSource make_source, Limits limits, Log& log, std::stop_token stop);

  /// Back to the first frame. Call once, first.
  [[nodiscard]] Result<void> rewind();

  /// The next frame; null at the end. Bad frames of the source are left out.
  [[nodiscard]] Result<std::shared_ptr<const Frame>> next();
  /// The frame that next() will return.
  [[nodiscard]] Result<std::shared_ptr<const Frame>> peek();

  /// What a system gets that becomes free at `now_s` of the frames' time: the newest frame that has
  /// arrived by then, i.e. has a stamp of no more than `now_s`, or else the next to come.
  struct Taken {
    std::shared_ptr<const Frame> frame;  ///< Null at the end.
    std::int64_t late = 0;               ///< Frames passed over.
  };
  [[nodiscard]] Result<Taken> next_newest(double now_s);

  /// Frames in all, as far as that is known.
  [[nodiscard]] std::optional<std::int64_t> frame_count() const noexcept { return count_; }
  /// Mistakes of the source in the frames read so far.
  [[nodiscard]] const std::vector<Error>& bad_frames() const noexcept { return bad_frames_; }
  /// The scene behind the frames; null where it is not known.
  [[nodiscard]] const Scene* scene() const noexcept { return scene_.get(); }

 private:
  [[nodiscard]] Result<void> open();
  [[nodiscard]] Result<void> fill();
  /// One frame of the source, bad ones passed over; null at its end.
  [[nodiscard]] Result<std::shared_ptr<const Frame>> read();

  MakeSource make_source_;
  Limits limits_;
  Log& log_;
  std::stop_token stop_;
  std::optional<PluginPtr<Source>> source_;
  std::shared_ptr<const Scene> scene_;
  std::optional<std::int64_t> count_;
  std::deque<std::shared_ptr<const Frame>> window_;
  std::size_t at_ = 0;          ///< Of the next frame, in the window.
  std::int64_t read_ = 0;       ///< Frames taken of the source since it was opened.
  bool at_end_ = false;         ///< The source has no more.
  bool is_whole_ = false;       ///< The window holds all frames.
  bool has_been_read_ = false;  ///< To the end, once: mistakes are told once.
  std::vector<Error> bad_frames_;
};

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
  std::int64_t index = 0;  ///< Among all cases.
  SystemCase what;         ///< Read back, without what measuring needs.
  bool is_signed = false;  ///< As the published fields say.
  std::optional<ClockRecord> every_frame;
  std::optional<ClockRecord> real_time;
  std::string error;       ///< Why it could not be measured; empty if it was.
  bool has_truth = false;  ///< The scene behind the frames is known.
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

// Results.

/// What a results store holds of a mapping benchmark.
struct MappingBenchmarkRecord : DividedRun {
  std::string reference;
  std::string published_as;
  ExpectSettings expect;
  std::int64_t all_cases = 0;  ///< Of all shards.
  std::vector<CaseRecord> cases = {};
  std::vector<std::string> bad_frames = {};  ///< What is wrong with each, of the source.

  /// Whether a case is this shard's.
  [[nodiscard]] bool is_ours(std::int64_t index) const noexcept {
    return index % shard.count == shard.index;
  }
  /// Cases that the store should come to hold.
  [[nodiscard]] std::int64_t planned() const noexcept {
    return (all_cases + shard.count - 1 - shard.index) / shard.count;
  }
  [[nodiscard]] bool complete() const {
    return std::ssize(cases) == planned() && std::ranges::none_of(cases, &CaseRecord::interrupted);
  }
};

/// Everything but what is measured: series "benchmark".
void record_mapping_head(const MappingBenchmarkRecord& record, Recorder& recorder);
/// Series "system" (one item a case); "update" and "real_time" (one item a case, on each clock) and
/// "truth"; of the case with index I, "update/I" and "real_time/I", one item a frame.
void record_case(const CaseRecord& record, Recorder& recorder);

/// Reads back what was recorded. Fails with kIo where the store is of no mapping benchmark.
[[nodiscard]] Result<MappingBenchmarkRecord> read_mapping_record(const std::filesystem::path& file);

/// Puts the stores of shards together in the folder `out`.
[[nodiscard]] Result<void> merge_mapping(const std::vector<std::filesystem::path>& shards,
                                         const std::filesystem::path& out);

/// Verdict, summary.json and tables of what a store holds.
[[nodiscard]] ExperimentOutcome summarise_mapping(const MappingBenchmarkRecord& record,
                                                  bool stopped, const std::optional<Error>& fault);

/// Of the rows `systems` of summary.json.
[[nodiscard]] const report::ResultColumns& mapping_columns();

}  // namespace sidestep
