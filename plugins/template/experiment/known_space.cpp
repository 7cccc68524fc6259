// An experiment: how much of a map is known after each frame, and whether that is enough.

#include <bit>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/entry_reading.hpp>
#include <sidestep/runtime/experiment.hpp>

namespace known_space {
namespace {

using namespace sidestep;
using report::Json;

struct Settings : ExperimentSettings {
  double wanted_share = 0.5;

  static Parameters<Settings> parameters() {
    return experiment_parameters<Settings>().add("wanted_share", &Settings::wanted_share,
                                                 "Of the map that is to be known at the end.",
                                                 {.min = 0.0, .max = 1.0});
  }
};

/// The map after a frame.
struct Row {
  std::int64_t frame = 0;
  double integrate_ms = 0.0;
  double known_share = 0.0;
};

/// What the rows hold, declared once: summary.json, table.csv, the tables of terminal and page, the
/// comparison of runs and the reference page of results follow.
const report::ResultColumnsOf<Row>& columns() {
  static const auto kColumns =
      report::ResultColumnsOf<Row>("/frames")
          .table("Frame by frame")
          .add("frame", &Row::frame, "Its number in the source.", {.heading = "frame"})
          .add("integrate_ms", &Row::integrate_ms, "Wall time inside the mapper.",
               {.heading = "integrate", .pattern = "%.1f ms"})
          .add("known_share", &Row::known_share, "Of the map's voxels, those observed so far.",
               {.heading = "known", .pattern = "%.3f"});
  return kColumns;
}

double known_share(const OccupancyView& map) {
  std::int64_t known = 0;
  for (const std::uint64_t word : map.known().words) known += std::popcount(word);
  return static_cast<double>(known) / static_cast<double>(map.occupancy_grid().voxel_count());
}

/// Maps every frame, and stores what each made of the map as soon as it is known.
Result<std::vector<Row>> map_frames(ExperimentContext& context, Recorder& recorder) {
  const Configuration& configuration = context.configuration;
  auto source = SIDESTEP_TRY(context.host.create<Source>(block_of(configuration, "source")));
  auto mapper = SIDESTEP_TRY(context.host.create<Mapper>(block_of(configuration, "mapper")));
  const auto& map = dynamic_cast<const OccupancyView&>(*mapper);  // check() has asked
  std::vector<Row> rows;
  while (!context.stop.stop_requested()) {
    const auto frame = SIDESTEP_TRY(
        call_stage(plugin_of(source), [&] { return source->next(Deadline(context.stop)); }));
    if (!frame) break;
    const Stopwatch watch;
    SIDESTEP_TRY(call_stage(plugin_of(mapper), [&] { return mapper->integrate(*frame); }));
    const Row row{frame->sequence, watch.elapsed_ms(), known_share(map)};
    const auto item = static_cast<std::int64_t>(rows.size());
    recorder.add("frame", item, "integrate_ms", row.integrate_ms);
    recorder.add("frame", item, "known_share", row.known_share);
    rows.push_back(row);
    if (context.progress) context.progress(item + 1, source->frame_count().value_or(0), "mapping");
  }
  return rows;
}

/// What the page shows between verdict and configuration.
Result<std::string> page(const Json& summary, ResultsReader&, const std::filesystem::path&) {
  return columns().html(columns().rows_of(summary));
}

class KnownSpace final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override { return {.blocks = {"source", "mapper"}}; }

  [[nodiscard]] const report::RunReport& report() const override {
    static const report::RunReport kReport = {
        .body = &page,
        .columns = &columns(),
        .compared_of_run = {{"known", "/known_share", "%.3f"}},
        .compared_rows = [](const Json&) { return Json::array({Json::object()}); }};  // one a run
    return kReport;
  }

  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    host.check_views(block_of(configuration, "mapper"), {OccupancyView::kViewName},
                     "the experiment", errors);
  }

  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto settings = SIDESTEP_TRY(read_block<Settings>(context.configuration, "experiment"));

    const RunProvenance provenance = provenance_of(context);
    auto store = SIDESTEP_TRY(ResultsStore::open(context.out / "results.sqlite", provenance));
    Recorder recorder(*store);
    const auto rows = map_frames(context, recorder);
    SIDESTEP_TRY(recorder.commit());
    if (!rows) return error_of(rows);

    Json frames = Json::array();
    for (const Row& row : *rows) frames.push_back(columns().row(row));
    const double known = rows->empty() ? 0.0 : rows->back().known_share;
    ExperimentOutcome outcome;
    outcome.interrupted = context.stop.stop_requested();
    outcome.success = !outcome.interrupted && known >= settings.wanted_share;
    outcome.verdict = std::string(outcome.success ? "Success" : "Failed") + ": " +
                      std::to_string(static_cast<int>(100.0 * known)) + " % of the map is known.";
    outcome.table = columns().text(frames);
    outcome.table_csv = columns().csv(frames);
    outcome.summary_json = summary_text(provenance, "known_space", outcome,
                                        {{"known_share", known}, {"frames", frames}});
    return outcome;
  }
};

}  // namespace
}  // namespace known_space

SIDESTEP_EXPERIMENT(known_space::KnownSpace, known_space::Settings, "known_space", "0.1.0",
                    "How much of a map is known after each frame")
