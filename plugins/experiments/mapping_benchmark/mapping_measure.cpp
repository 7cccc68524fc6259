#include "mapping_parts.hpp"

#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <utility>

#include <sidestep/measures/point_survey.hpp>
#include <sidestep/measures/source_facts.hpp>
#include <sidestep/runtime/pipeline.hpp>

namespace sidestep {
namespace {

/// Memory of this process that is in RAM, in MiB; what was freed is given back first. 0 where the
/// system does not tell.
double resident_mib(bool trim) {
  if (trim) malloc_trim(0);
  std::ifstream file("/proc/self/statm");
  double pages = 0.0, resident_pages = 0.0;
  if (!(file >> pages >> resident_pages)) return 0.0;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGE_SIZE)) / (1 << 20);
}

/// Hands one frame at a time to a MappingPipeline. [mapping]
class OneFrameSource final : public Source {
 public:
  void set(std::shared_ptr<const Frame> frame) { frame_ = std::move(frame); }
  Result<std::optional<Frame>> next(const Deadline&) override {
    const auto frame = std::exchange(frame_, nullptr);
    return frame != nullptr ? std::optional(*frame) : std::nullopt;
  }
  std::optional<std::int64_t> frame_count() const override { return std::nullopt; }

 private:
  std::shared_ptr<const Frame> frame_;
};

/// A mapper, a field and the pipeline through them.
struct System {
  PluginPtr<Mapper> mapper;
  PluginPtr<FieldBuilder> field_builder;
  PointSurvey points;
  Log& log;
  OneFrameSource source = {};
  SnapshotSlot slot = {};
  MappingPipeline pipeline{
      MappingPipeline::Parts{source,
                             *mapper,
                             *field_builder,
                             slot,
                             log,
                             {"frames", plugin_of(mapper), plugin_of(field_builder)}}};
  /// Of the mapper; null where it has none.
  const OccupancyView* occupancy = dynamic_cast<const OccupancyView*>(mapper.get());

  /// Why nothing of what was measured is in the map; empty where something is.
  [[nodiscard]] std::string emptiness() const {
    constexpr auto kKeys = PointSurvey::Keys::kMappingBenchmark;
    std::string why;
    if (occupancy != nullptr) {
      why = points.emptiness(*occupancy, kKeys);
    } else if (!points.reaches_grid()) {
      why = points.describe(mapper->grid(), kKeys);
    }
    return why.empty() ? "" : "the map is empty: " + why;
  }
};

Result<std::unique_ptr<System>> make_system(const SystemCase& what, MeasureContext& context) {
  auto mapper = SIDESTEP_TRY(context.host.create<Mapper>(what.mapper_block, context.robot));
  auto field_builder =
      SIDESTEP_TRY(context.host.create<FieldBuilder>(what.field_block, context.robot));
  std::unique_ptr<System> system(new System{
      std::move(mapper), std::move(field_builder),
      PointSurvey::of_mapper(context.host.with_defaults(PluginKind::kMapper, what.mapper_block)),
      context.log});
  SIDESTEP_TRY(system->pipeline.attach());
  return system;
}

enum class Step { kDone, kBadFrame, kEnd };

/// One frame through the system and into the clock's record. It ends where it is asked to stop, and
/// where the system fails, which goes into the record.
Step take(System& system, const std::shared_ptr<const Frame>& frame, ClockRecord& clock,
          CaseRecord& record, MeasureContext& context) {
  system.source.set(frame);
  const auto step = system.pipeline.step(Deadline(context.stop));
  if (!step) {
    if (!context.stop.stop_requested()) record.error = step.error().describe();
    return Step::kEnd;
  }
  system.points.add(*frame, system.mapper->grid());
  context.updated();
  if (!*step) {
    ++clock.bad_frames;
    return Step::kBadFrame;
  }
  const MappingStep& done = **step;
  if (done.update.grid_moved) {
    record.error = Error{ErrorCode::kUnsupported,
                         "the mapper's grid moved; systems are compared on one grid",
                         "frame " + std::to_string(done.frame_sequence),
                         {},
                         nullptr}
                       .describe();
    return Step::kEnd;
  }
  clock.updates.push_back({.frame_sequence = done.frame_sequence,
                           .integrate_ms = done.integrate_ms,
                           .field_ms = done.field_ms,
                           .publish_ms = done.publish_ms});
  clock.updates.back().latency_ms = clock.updates.back().frame_ms();
  record.is_signed = system.slot.pin()->info().is_signed;
  return Step::kDone;
}

void check_accuracy(const System& system, MeasureContext& context, bool unknown_occupied,
                    ClockRecord& clock) {
  const auto field = system.slot.pin();
  if (system.occupancy == nullptr || field == nullptr || context.settings.accuracy_every == 0) {
    return;
  }
  clock.accuracy.add(compare_with_exact(*field, *system.occupancy, context.settings.max_distance_m,
                                        unknown_occupied));
  ++clock.accuracy_checks;
}

/// As fast as possible over every frame; accuracy and truth are measured between the updates.
/// Fails where frames cannot be had; a fault of the system goes into the record.
Result<void> run_every_frame(System& system, double before_mib, CaseRecord& record,
                             MeasureContext& context) {
  ClockRecord& clock = record.every_frame.emplace();
  const double without_truth_mib = resident_mib(false);
  std::optional<MapTruth> truth;
  const Scene* scene = context.feed.scene();
  if (scene != nullptr && context.settings.truth.measure && system.occupancy != nullptr) {
    truth.emplace(*scene, system.occupancy->occupancy_grid(), context.settings.truth);
  }
  before_mib += resident_mib(false) - without_truth_mib;  // not the system's
  const std::int64_t every = context.settings.accuracy_every;
  bool is_checked = true;
  while (!context.stop.stop_requested()) {
    const auto frame = SIDESTEP_TRY(context.feed.next());
    if (frame == nullptr) break;
    const Step step = take(system, frame, clock, record, context);
    if (step == Step::kEnd) break;
    if (step == Step::kBadFrame) continue;
    clock.updates.back().resident_mib = resident_mib(false) - before_mib;
    if (truth) truth->observe(*frame, *system.occupancy);
    is_checked = every > 0 && static_cast<std::int64_t>(clock.updates.size()) % every == 0;
    if (is_checked) check_accuracy(system, context, record.what.unknown_occupied, clock);
  }
  if (!is_checked) check_accuracy(system, context, record.what.unknown_occupied, clock);
  if (truth) clock.truth = truth->finish(*system.occupancy);
  if (record.error.empty() && !clock.updates.empty()) record.error = system.emptiness();
  return {};
}

/// Frames arrive when their stamps say and every update takes the time that it takes; which frames
/// come too late follows from that without waiting for any.
Result<void> run_real_time(System& system, double, CaseRecord& record, MeasureContext& context) {
  ClockRecord& clock = record.real_time.emplace();
  double now_s = 0.0, first_published_s = 0.0;
  while (!context.stop.stop_requested()) {
    const auto taken = SIDESTEP_TRY(context.feed.next_newest(now_s));
    if (taken.frame == nullptr) break;
    for (std::int64_t i = 0; i < taken.late; ++i) context.updated();
    clock.dropped += taken.late;
    const double arrival_s = taken.frame->stamp.seconds();
    now_s = clock.updates.empty() ? arrival_s : std::max(now_s, arrival_s);
    const Step step = take(system, taken.frame, clock, record, context);
    if (step == Step::kEnd) break;
    if (step == Step::kBadFrame) continue;
    now_s += 1e-3 * clock.updates.back().frame_ms();
    clock.updates.back().latency_ms = 1e3 * (now_s - arrival_s);
    if (clock.updates.size() == 1) first_published_s = now_s;
    clock.duration_s = now_s - first_published_s;
  }
  if (record.error.empty() && !clock.updates.empty()) record.error = system.emptiness();
  return {};
}

/// One clock, with a system of its own.
Result<void> with_system(CaseRecord& record, MeasureContext& context,
                         Result<void> (*run)(System&, double before_mib, CaseRecord&,
                                             MeasureContext&)) {
  SIDESTEP_TRY(context.feed.rewind());
  const double before_mib = resident_mib(true);
  auto system = make_system(record.what, context);
  if (!system) {
    record.error = system.error().describe();
    return {};
  }
  return run(**system, before_mib, record, context);
}

}  // namespace

FrameFeed::FrameFeed(MakeSource make_source, Limits limits, Log& log, std::stop_token stop)
    : make_source_(std::move(make_source)), limits_(limits), log_(log), stop_(std::move(stop)) {}

Result<void> FrameFeed::open() {
  source_.reset();  // two at once may not be had, e.g. of a camera
  auto source = SIDESTEP_TRY(make_source_());
  source_.emplace(std::move(source));
  if (scene_ == nullptr) scene_ = SIDESTEP_TRY(true_scene(*source_));
  count_ = SIDESTEP_TRY(frame_count_of(*source_));
  if (count_) count_ = (*count_ + limits_.stride - 1) / limits_.stride;
  if (limits_.frames > 0) count_ = std::min(count_.value_or(limits_.frames), limits_.frames);
  read_ = 0;
  at_end_ = false;
  return {};
}

Result<void> FrameFeed::rewind() {
  at_ = 0;
  if (is_whole_) return {};
  window_.clear();
  SIDESTEP_TRY(open());
  SIDESTEP_TRY(fill());
  is_whole_ = at_end_;
  if (is_whole_) source_.reset();
  return {};
}

Result<void> FrameFeed::fill() {
  window_.clear();
  at_ = 0;
  while (static_cast<int>(window_.size()) < limits_.in_memory) {
    auto frame = SIDESTEP_TRY(read());
    if (frame == nullptr) {
      at_end_ = true;
      has_been_read_ = true;
      break;
    }
    window_.push_back(std::move(frame));
  }
  return {};
}

Result<std::shared_ptr<const Frame>> FrameFeed::read() {
  const std::int64_t last = limits_.frames > 0 ? limits_.frames * limits_.stride : 0;
  while (last == 0 || read_ < last) {
    // Asked to stop, the source fails; what was read until then is what there is.
    if (stop_.stop_requested()) break;
    auto frame = call_stage(plugin_of(*source_), [&] { return (*source_)->next(Deadline(stop_)); });
    if (!frame && frame.error().code == ErrorCode::kBadFrame) {
      ++read_;
      if (has_been_read_) continue;
      log_.warn("skipped: " + frame.error().describe());
      bad_frames_.push_back(std::move(frame.error()));
      continue;
    }
    if (!frame && stop_.stop_requested()) break;
    if (!frame) return error_of(frame);
    if (!*frame) break;
    if (read_++ % limits_.stride == 0) return std::make_shared<const Frame>(std::move(**frame));
  }
  return std::shared_ptr<const Frame>();
}

Result<std::shared_ptr<const Frame>> FrameFeed::peek() {
  if (at_ == window_.size() && !at_end_ && !is_whole_) {
    SIDESTEP_TRY(fill());
  }
  if (at_ == window_.size()) return std::shared_ptr<const Frame>();
  return window_[at_];
}

Result<std::shared_ptr<const Frame>> FrameFeed::next() {
  auto frame = peek();
  if (frame && *frame != nullptr) ++at_;
  return frame;
}

Result<FrameFeed::Taken> FrameFeed::next_newest(double now_s) {
  Taken taken;
  for (;;) {
    auto frame = SIDESTEP_TRY(next());
    if (frame == nullptr) return taken;
    if (taken.frame != nullptr) ++taken.late;
    taken.frame = std::move(frame);
    const auto after = SIDESTEP_TRY(peek());
    if (after == nullptr || after->stamp.seconds() > now_s) return taken;
  }
}

Result<CaseRecord> measure_case(const SystemCase& what, MeasureContext& context) {
  CaseRecord record;
  record.what = what;
  if (context.settings.on_every_frame()) {
    SIDESTEP_TRY(with_system(record, context, &run_every_frame));
  }
  if (context.settings.in_real_time() && record.error.empty() && !context.stop.stop_requested()) {
    SIDESTEP_TRY(with_system(record, context, &run_real_time));
  }
  record.interrupted = context.stop.stop_requested();
  return record;
}

}  // namespace sidestep
