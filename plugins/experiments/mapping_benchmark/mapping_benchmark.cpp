#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <sidestep/core/index.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/checked_robot.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/entry_reading.hpp>

#include "mapping_parts.hpp"

namespace sidestep {
namespace {

using namespace report;

constexpr double kWidth = 900.0;
constexpr double kLabels = 250.0;
constexpr double kNumbers = 70.0;
constexpr double kRow = 24.0;
constexpr double kGroupHead = 30.0;

/// A logarithmic scale of milliseconds, whole decades.
struct LogScale {
  int from = 0;  ///< Powers of ten.
  int to = 1;

  [[nodiscard]] double at(double value_ms) const {
    const double share = (std::log10(std::max(value_ms, 1e-6)) - from) / (to - from);
    return kLabels + std::clamp(share, 0.0, 1.0) * (kWidth - kLabels - kNumbers);
  }
};

/// 0 where there is none.
double number_of(const Json& system, const char* pointer) {
  const Json number = at(system, pointer);
  return number.is_number() ? number.get<double>() : 0.0;
}

LogScale scale_of(const Json& systems) {
  double least = 1e9, most = 0.0;
  for (const Json& system : systems) {
    for (const char* time : {"/frame_ms/mean", "/frame_ms/p50", "/frame_ms/p95", "/published_ms"}) {
      const double value = number_of(system, time);
      if (value > 0.0) least = std::min(least, value);
      most = std::max(most, value);
    }
  }
  if (!(most > 0.0)) return {};
  const int from = static_cast<int>(std::floor(std::log10(least) - 0.05));
  return {from, std::max(from + 1, static_cast<int>(std::ceil(std::log10(most))))};
}

void draw_scale(Canvas& canvas, const LogScale& scale, double top, double bottom) {
  for (int decade = scale.from; decade <= scale.to; ++decade) {
    const double x = scale.at(std::pow(10.0, decade));
    canvas.line(std::array{Point{x, top}, Point{x, bottom}}, {colour(0xDDDDDD), 1.0, {}});
    canvas.text({x, top - 5.0}, format("%g ms", std::pow(10.0, decade)),
                {.size = 11.0, .align = Align::kCentre});
  }
}

void draw_bar(Canvas& canvas, const LogScale& scale, const Json& system, double top) {
  const double middle = top + 0.5 * kRow;
  canvas.text({kLabels - 10.0, middle + 4.0}, cell(at(system, "/name")),
              {.size = 12.0, .align = Align::kRight});
  const bool is_signed = at(system, "/signed") == Json(true);
  const double p50_ms = number_of(system, "/frame_ms/p50");
  const double end = scale.at(p50_ms), p95 = scale.at(number_of(system, "/frame_ms/p95"));
  canvas.rectangle({kLabels, top + 4.0, std::max(1.0, end - kLabels), kRow - 8.0},
                   is_signed ? palette::kOrange : palette::kBlue);
  const Stroke thin{palette::kBlack, 1.2, {}};
  canvas.line(std::array{Point{end, middle}, Point{p95, middle}}, thin);
  canvas.line(std::array{Point{p95, middle - 5.0}, Point{p95, middle + 5.0}}, thin);
  if (at(system, "/published_ms").is_number()) {
    canvas.ring({scale.at(number_of(system, "/published_ms")), middle}, 5.0,
                {palette::kVermilion, 2.0, {}});
  }
  canvas.text({kWidth - kNumbers + 8.0, middle + 4.0}, format("%.3g ms", p50_ms), {.size = 12.0});
}

/// A bar for each system that could be measured. `published_as` names where published figures are
/// from.
std::vector<Figure> mapping_figures(const Json& systems, const std::string& published_as) {
  std::vector<Figure> figures;
  std::map<double, Json> by_resolution;
  Json measured = Json::array();
  for (const Json& system : systems) {
    if (!at(system, "/frame_ms/p50").is_number()) continue;
    measured.push_back(system);
    by_resolution[number_of(system, "/resolution_m")].push_back(system);
  }
  if (measured.empty()) return figures;
  const double height = 34.0 + (kGroupHead + 24.0) * static_cast<double>(by_resolution.size()) +
                        kRow * static_cast<double>(measured.size());
  figures.push_back({"mapping_times",
                     "Time from a frame in hand to the published field (logarithmic): bars to the "
                     "median, whiskers to the 95th percentile.",
                     Canvas(kWidth, height)});
  Canvas& canvas = figures.back().canvas;
  const LogScale scale = scale_of(measured);
  double y = 0.0;
  for (const auto& [resolution_m, group] : by_resolution) {
    canvas.text({0.0, y + 18.0}, format("%g m", resolution_m), {.size = 13.0, .bold = true});
    y += kGroupHead;
    draw_scale(canvas, scale, y, y + kRow * static_cast<double>(group.size()));
    for (const Json& system : group) {
      draw_bar(canvas, scale, system, y);
      y += kRow;
    }
    y += 24.0;
  }
  std::vector<LegendEntry> legend = {
      {"unsigned", LegendEntry::Mark::kBox, {palette::kBlue, 1.0, {}}},
      {"signed", LegendEntry::Mark::kBox, {palette::kOrange, 1.0, {}}}};
  if (std::ranges::any_of(
          measured, [](const Json& system) { return at(system, "/published_ms").is_number(); })) {
    legend.push_back(
        {published_as + ", mean", LegendEntry::Mark::kCircle, {palette::kVermilion, 2.0, {}}});
  }
  draw_legend(canvas, {0.0, y}, kWidth, legend);
  return figures;
}

/// Name, field, resolution: what every table begins with.
const Columns kHead = {{"system", "/name"},
                       {"field", "/signed", "signed|unsigned"},
                       {"voxel", "/resolution_m", "%g m"}};

std::string quarters_section(const Json& summary) {
  std::vector<Row> rows;
  for (const Json& s : at(summary, "/systems")) {
    Row times = cells_of(s, kHead), memory = cells_of(s, kHead);
    times.push_back("frame p50");
    memory.push_back("memory");
    for (const Json& quarter : at(s, "/quarters")) {
      times.push_back(cell(at(quarter, "/frame_ms/p50"), "%.2f ms"));
      memory.push_back(cell(at(quarter, "/memory_mib"), "%.0f MiB"));
    }
    rows.push_back(std::move(times));
    rows.push_back(std::move(memory));
  }
  return "<h2>By quarter of the run</h2>\n" +
         html_table({"system", "field", "voxel", "", "first", "second", "third", "fourth"}, rows);
}

std::string errors_section(const Json& summary) {
  std::string html;
  for (const Json& s : at(summary, "/systems")) {
    for (const char* key : {"/error", "/unmet"}) {
      const std::string text = cell(at(s, key));
      if (text.empty() || text == "-") continue;
      const Row head = cells_of(s, kHead);
      html += "<p class=\"verdict failure\">" +
              escape_html(head[0] + ", " + head[1] + ", " + head[2] + ": " + text) + "</p>\n";
    }
  }
  return html;
}

Result<std::string> mapping_body(const Json& summary, ResultsReader&,
                                 const std::filesystem::path& run) {
  const Json systems = at(summary, "/systems");
  const std::string published_as = cell(at(summary, "/published_as"));
  std::string html = errors_section(summary);
  html += SIDESTEP_TRY(figure_section(mapping_figures(systems, published_as), run));
  if (published_as != "-" && !published_as.empty()) {
    html += "<p>Published: " + escape_html(published_as) + ".</p>\n";
  }
  html += mapping_columns().html(systems);
  return html + quarters_section(summary);
}

/// What the store in the folder `run` comes to.
Result<ExperimentOutcome> conclude_mapping(const std::filesystem::path& run, bool stopped,
                                           const std::optional<Error>& fault) {
  const auto record = SIDESTEP_TRY(read_mapping_record(run / "results.sqlite"));
  return summarise_mapping(record, stopped, fault);
}

/// The benchmark before anything is measured, or with what an earlier session has left, where this
/// run goes on with it.
Result<MappingBenchmarkRecord> begun_record(const ExperimentContext& context,
                                            const MappingBenchmarkSettings& settings,
                                            std::int64_t cases) {
  MappingBenchmarkRecord record{divided_run_of(context), settings.reference, settings.published_as,
                                settings.expect, cases};
  record.identity = identity_of(context, {"threads", "frames_in_memory"});
  if (context.shard.count > cases) {
    return fail(ErrorCode::kConfig,
                "there are " + std::to_string(cases) + " cases, too few for " +
                    std::to_string(context.shard.count) + " shards",
                context.configuration.file.string());
  }
  if (!context.resume) return record;
  const auto file = context.out / "results.sqlite";
  auto earlier = SIDESTEP_TRY(read_mapping_record(file));
  SIDESTEP_TRY(check_same_run(earlier, record, file.string()));
  return earlier;
}

/// A run of a benchmark: the cases of its shard that are not measured yet.
struct MappingRun {
  const std::vector<SystemCase>& cases;
  const MappingBenchmarkRecord& record;  ///< Of earlier sessions.
  const MappingBenchmarkSettings& settings;
  ExperimentContext& context;
  Recorder& recorder;
  SessionClock clock{context.threads};

  [[nodiscard]] std::vector<std::int64_t> left() const {
    std::vector<std::int64_t> left;
    for (std::int64_t index = 0; index < std::ssize(cases); ++index) {
      const bool is_done = std::ranges::any_of(record.cases, [&](const CaseRecord& one) {
        return one.index == index && !one.interrupted;
      });
      if (record.is_ours(index) && !is_done) left.push_back(index);
    }
    return left;
  }

  [[nodiscard]] Result<void> measure() {
    std::shared_ptr<const RobotModel> robot;  // whose own points mappers remove
    if (const Node* block = context.configuration.root.find("robot")) {
      robot = SIDESTEP_TRY(context.host.create<RobotModel>(*block));
    }
    const Node& source = block_of(context.configuration, "source");
    FrameFeed feed([&] { return context.host.create<Source>(source, robot); },
                   {settings.frames, settings.stride, settings.frames_in_memory}, context.log,
                   context.stop);
    MeasureContext measuring{context.host, context.log, robot, feed, settings, context.stop, {}};
    const std::int64_t clocks = settings.clock == "both" ? 2 : 1;
    const std::vector<std::int64_t> cases_left = left();
    std::int64_t done = 0;
    if (context.progress) context.progress(0, 0, "reading frames");
    for (const std::int64_t index : cases_left) {
      if (context.stop.stop_requested()) break;
      const SystemCase& what = cases[idx(index)];
      const std::string label = what.label(what.is_signed.value_or(false));
      measuring.updated = [&] {
        const auto total = feed.frame_count().value_or(0) * clocks * std::ssize(cases_left);
        if (context.progress) context.progress(++done, total, label);
      };
      auto measured = SIDESTEP_TRY(measure_case(what, measuring));
      if (!measured.error.empty()) context.log.error(label + ": " + measured.error);
      measured.index = index;
      measured.has_truth = feed.scene() != nullptr;
      record_case(measured, recorder);
      record_bad_frames(feed.bad_frames(), recorder);
      SIDESTEP_TRY(save(measured.interrupted ? 0 : 1));
    }
    return save(0);
  }
  [[nodiscard]] Result<void> save(std::int64_t measured) {
    record_session(clock.after(measured), std::ssize(record.sessions), recorder);
    return recorder.commit();
  }
};

class MappingBenchmark final : public Experiment {
 public:
  [[nodiscard]] ExperimentFacts facts() const override {
    return {.blocks = {"source"}, .optional_blocks = {"robot"}, .is_divisible = true};
  }
  [[nodiscard]] const report::RunReport& report() const override {
    static const RunReport kReport = {
        .body = &mapping_body, .columns = &mapping_columns(), .pictures = {"mapping_times."}};
    return kReport;
  }
  void check(const Configuration& configuration, Host& host,
             std::vector<Error>& errors) const override {
    const Node* experiment = configuration.root.find("experiment");
    if (experiment != nullptr) (void)read_cases(*experiment, host, errors);
    (void)checked_robot(configuration, host, errors);
  }
  [[nodiscard]] Result<ExperimentOutcome> run(ExperimentContext& context) const override {
    const auto settings =
        SIDESTEP_TRY(read_block<MappingBenchmarkSettings>(context.configuration, "experiment"));
    std::vector<Error> errors;
    const std::vector<SystemCase> cases =
        read_cases(block_of(context.configuration, "experiment"), context.host, errors);
    if (!errors.empty()) return tl::make_unexpected(std::move(errors.front()));
    const auto record = SIDESTEP_TRY(begun_record(context, settings, std::ssize(cases)));
    auto store = SIDESTEP_TRY(open_store(context, record.provenance));
    Recorder recorder(*store);
    if (!context.resume) record_mapping_head(record, recorder);
    SIDESTEP_TRY(recorder.commit());
    const auto measured = MappingRun{cases, record, settings, context, recorder}.measure();
    store.reset();
    return conclude_mapping(context.out, context.stop.stop_requested(),
                            measured ? std::nullopt : std::optional<Error>(measured.error()));
  }
  [[nodiscard]] Result<ExperimentOutcome> merge(const std::vector<std::filesystem::path>& shards,
                                                const std::filesystem::path& out) const override {
    SIDESTEP_TRY(merge_mapping(shards, out));
    return conclude_mapping(out, false, std::nullopt);
  }
};

}  // namespace
}  // namespace sidestep

SIDESTEP_EXPERIMENT(sidestep::MappingBenchmark, sidestep::MappingBenchmarkSettings,
                    "mapping_benchmark", "0.1.0",
                    "Systems of mapper and field on the same frames: time, accuracy, memory")
