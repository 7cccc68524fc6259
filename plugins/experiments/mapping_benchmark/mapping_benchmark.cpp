#include <sidestep/core/format.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include "mapping_parts.hpp"

namespace sidestep {
namespace {

/// One item a frame.
void record_clock(const std::string& series, const std::optional<ClockRecord>& clock,
                  Recorder& recorder) {
  if (!clock) return;
  using U = UpdateRecord;
  static const auto kUpdate = StoredRow<U>()
                                  .add("sequence", &U::frame_sequence)
                                  .add("integrate_ms", &U::integrate_ms)
                                  .add("field_ms", &U::field_ms)
                                  .add("publish_ms", &U::publish_ms)
                                  .add_derived("frame_ms", &U::frame_ms)
                                  .add("latency_ms", &U::latency_ms)
                                  .add("resident_mib", &U::resident_mib);
  kUpdate.record_all(clock->updates, series, recorder);
}

/// Series "system" (one item a case), and of the case with index `item`: "update/ITEM" and
/// "real_time/ITEM".
void record_case(const CaseRecord& record, std::int64_t item, Recorder& recorder) {
  recorder.add("system", item, "name", record.what.name);
  recorder.add("system", item, "mapper", record.what.mapper);
  recorder.add("system", item, "field", record.what.field);
  recorder.add("system", item, "signed", record.is_signed);
  recorder.add("system", item, "resolution_m", record.what.resolution_m);
  recorder.add("system", item, "error", record.error);
  record_clock("update/" + std::to_string(item), record.every_frame, recorder);
  record_clock("real_time/" + std::to_string(item), record.real_time, recorder);
}

std::string label_of(const SystemCase& what) {
  return what.name + (what.is_signed.value_or(false) ? ", signed" : "") + " at " +
         format("%g m", what.resolution_m);
}

/// Case after case; stops on request, with the case that was under way as far as it got.
Result<void> measure_cases(const std::vector<SystemCase>& cases, MeasureContext& measure,
                           ExperimentContext& context, Recorder& recorder,
                           MappingBenchmarkRecord& record) {
  const std::int64_t clocks =
      (measure.settings.on_every_frame() ? 1 : 0) + (measure.settings.in_real_time() ? 1 : 0);
  std::int64_t done = 0;
  for (const SystemCase& what : cases) {
    if (context.stop.stop_requested()) break;
    measure.updated = [&] {
      const auto frames = measure.feed.frame_count().value_or(0);
      const auto total = frames * clocks * static_cast<std::int64_t>(cases.size());
      if (context.progress) context.progress(++done, total, label_of(what));
    };
    auto measured = SIDESTEP_TRY(measure_case(what, measure));
    if (!measured.error.empty()) context.log.error(label_of(what) + ": " + measured.error);
    record_case(measured, static_cast<std::int64_t>(record.cases.size()), recorder);
    record.cases.push_back(std::move(measured));
    SIDESTEP_TRY(recorder.commit());
  }
  return {};
}

class MappingBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"source"}, .optional_blocks = {"robot"}};
  }
  [[nodiscard]] const report::RunReport& report() const override { return mapping_report(); }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    const Node* experiment = configuration.root.find("experiment");
    if (experiment != nullptr) (void)read_cases(*experiment, host, errors);
    (void)checked_robot(configuration, host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const Node& experiment = *context.configuration.root.find("experiment");
    const Node& source = *context.configuration.root.find("source");
    const auto settings =
        SIDESTEP_TRY(read_block<MappingBenchmarkSettings>(context.configuration, "experiment"));
    std::vector<Error> errors;
    const std::vector<SystemCase> cases = read_cases(experiment, context.host, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    std::shared_ptr<const RobotModel> robot;  // whose own points mappers remove
    if (const Node* block = context.configuration.root.find("robot")) {
      robot = SIDESTEP_TRY(context.host.create<RobotModel>(*block));
    }

    const RunProvenance provenance = provenance_of(context);
    auto store = SIDESTEP_TRY(ResultsStore::open(context.out / "results.sqlite", provenance));
    Recorder recorder(*store);

    FrameFeed feed([&] { return context.host.create<Source>(source, robot); },
                   {settings.frames, settings.stride, settings.frames_in_memory}, context.log,
                   context.stop);
    MeasureContext measure{context.host, context.log, robot, feed, settings, context.stop, {}};
    MappingBenchmarkRecord record;
    record.planned_cases = cases.size();
    if (context.progress) context.progress(0, 0, "reading frames");
    SIDESTEP_TRY(measure_cases(cases, measure, context, recorder, record));
    record.bad_frames = feed.bad_frames();
    record.has_truth = feed.scene() != nullptr;
    record.interrupted = context.stop.stop_requested();
    record_bad_frames(record.bad_frames, recorder);
    SIDESTEP_TRY(recorder.commit());

    return summarise_mapping(provenance, settings, record);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::MappingBenchmark, sidestep::MappingBenchmarkSettings,
                    "mapping_benchmark", "0.1.0",
                    "Systems of mapper and field on the same frames: time, accuracy, memory")
