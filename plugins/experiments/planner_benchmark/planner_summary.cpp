#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <sidestep/core/format.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/yaml_document.hpp>
#include "planner_rows.hpp"

namespace sidestep {
namespace {

using namespace report;

/// A planner on some problems.
struct PlannerRow {
  const PlannerRecord& planner;
  std::string family;
  std::vector<SetSolve> solves;
  std::vector<SetSolve> solved = those_of(solves, &SetSolve::is_solved);

  [[nodiscard]] std::size_t problems() const {
    std::set<std::int64_t> problems;
    for (const SetSolve& solve : solves) problems.insert(solve.problem);
    return problems.size();
  }
};

/// The share of a row's answers that are accepted and come within a limit.
auto solved_within(double limit_ms) {
  return [limit_ms](const PlannerRow& row) {
    return share_of(row.solves,
                    [&](const SetSolve& s) { return s.is_solved() && s.first_ms() <= limit_ms; });
  };
}

/// A number of each answer that is accepted.
template <class Value>
auto of_solved(Value value) {
  return [value](const PlannerRow& row) { return values_of(row.solved, value); };
}

const report::ResultColumnsOf<PlannerRow>& planner_rows() {
  using R = PlannerRow;
  using S = SetSolve;
  static const auto kColumns =
      report::ResultColumnsOf<R>("/planners")
          .add("name", [](const R& r) { return r.planner.name; }, "Planner.",
               {.heading = "planner", .compared = true})
          .add("checker", [](const R& r) { return r.planner.checker; },
               "What checks its motions while it searches.",
               {.heading = "checker", .compared = true})
          .add("family", &R::family, "Family of problems, or `all`.", {.heading = "family"})
          .table("Answers",
                 "Solved: the independent check accepts the answer. Refused: it does not. First: "
                 "until the first valid answer; time: until the first one as smooth as the last.")
          .add("problems", &R::problems, "Problems it was given.")
          .add("answers", [](const R& r) { return r.solves.size(); },
               "Problems times seeds that have been tried.",
               {.heading = "answers", .pattern = "%.0f", .compared = true})
          .add("solved_share.s1", solved_within(1e3),
               "Share of the answers that come within 1 s and that the independent check accepts.",
               {.heading = "solved in 1 s", .pattern = "%.4f", .compared = true})
          .add("solved_share.s5", solved_within(5e3), "The same within 5 s.",
               {.heading = "in 5 s", .pattern = "%.4f"})
          .add("smooth_share",
               [](const R& r) {
                 return share_of(r.solves,
                                 [](const S& s) { return s.is_solved() && s.is_smooth(); });
               },
               "Share that is accepted and comes from an optimiser.",
               {.heading = "smooth", .pattern = "%.4f"})
          .spread("time_ms.", of_solved(&S::time_ms),
                  "Time until the first answer as smooth as the last one, of what is solved.",
                  {"p50", "p95"}, {.heading = "time", .pattern = "%.3f ms", .compared = true})
          .spread("first_valid_ms.", of_solved(&S::first_ms),
                  "Time until the first answer, of what is solved.", {"p50", "p95"},
                  {.heading = "first", .pattern = "%.3f ms"})
          .add("refused_by_check",
               [](const R& r) {
                 return std::ranges::count_if(r.solves,
                                              [](const S& s) { return !s.refusal.empty(); });
               },
               "Answers that the independent check refuses.",
               {.heading = "refused", .pattern = "%.0f", .compared = true})
          .add("certified_share",
               [](const R& r) -> Json {
                 const auto asked =
                     those_of(r.solved, [](const S& s) { return !s.certified.empty(); });
                 if (asked.empty()) return nullptr;
                 return share_of(asked, [](const S& s) { return s.certified == "proven"; });
               },
               "Share of the solved that is proven over all of its time, with certificates in the "
               "run's folder `certificates`; null where none was asked for.",
               {.heading = "proven", .pattern = "%.4f"})
          .table(
              "Motions",
              "Medians over what was solved. Acceleration: squared, over all joints and the whole "
              "motion, as a multiple of the least that one of its length and duration needs.")
          .spread("path_length_rad.", of_solved(&S::path_length),
                  "Length of the path in the space of joints, m and rad alike, of what is solved.",
                  {"p50"}, {.heading = "path", .pattern = "%.2f rad", .compared = true})
          .spread("duration_s.", of_solved(&S::duration_s),
                  "Duration of the motion, of what is solved.", {"p50"},
                  {.heading = "motion", .pattern = "%.2f s"})
          .spread("acceleration_ratio.", of_solved(&S::acceleration_ratio),
                  "Squared acceleration as a multiple of the least that a motion of its length and "
                  "duration needs, of what is solved.",
                  {"p50"}, {.heading = "acceleration", .pattern = "%.2f"})
          .spread("clearance_m.", of_solved(&S::clearance_m),
                  "Least clearance by the independent check, of what is solved.", {"p50"},
                  {.heading = "clearance", .pattern = "%.3f m"});
  return kColumns;
}

std::vector<std::string> families_of(const PlannerBenchmarkRecord& record) {
  std::vector<std::string> families;
  for (const ProblemName& name : record.names) {
    if (std::ranges::count(families, name.family) == 0) families.push_back(name.family);
  }
  return families;
}

Json family_rows(const PlannerBenchmarkRecord& record) {
  Json rows = Json::array();
  for (const PlannerRecord& planner : record.planners) {
    for (const std::string& family : families_of(record)) {
      const auto solves =
          those_of(planner.solves, [&](const SetSolve& s) { return s.family == family; });
      if (!solves.empty()) rows.push_back(planner_rows().row({planner, family, solves}));
    }
  }
  return rows;
}

/// What a planner does not reach of what its entry expects of it, by its row of the summary; empty
/// where it does.
std::string unmet_expectation(const PlannerRecord& planner, const Json& row) {
  std::vector<Error> errors;
  PlannerExpectation expect;
  const auto entry = parse_yaml(planner.settings, planner.name, errors);
  const Node* block = entry && entry->is_map() ? entry->find("expect") : nullptr;
  if (block != nullptr) PlannerExpectation::parameters().read(*block, expect, errors);
  if (!errors.empty()) return errors.front().describe();
  if (row["first_valid_ms"]["p50"].is_null()) return planner.name + " solves nothing";
  const auto complaint = [&](const char* key, const char* part, std::optional<double> bound,
                             bool is_least) -> std::string {
    const double value = row[key][part].get<double>();
    if (!bound || (is_least ? value >= *bound : value <= *bound)) return "";
    return planner.name + ": " + key + "." + part + format(" is %.4g", value) +
           (is_least ? " (at least " : " (at most ") + format("%.4g was expected)", *bound);
  };
  for (const std::string& unmet :
       {complaint("solved_share", "s1", expect.solved_share_1s, true),
        complaint("solved_share", "s5", expect.solved_share_5s, true),
        complaint("first_valid_ms", "p50", expect.first_p50_ms, false),
        complaint("first_valid_ms", "p95", expect.first_p95_ms, false)}) {
    if (!unmet.empty()) return unmet;
  }
  return "";
}

std::string verdict_text(const PlannerBenchmarkRecord& record, bool interrupted,
                         std::ptrdiff_t refused, const std::string& unmet,
                         const std::optional<Error>& fault) {
  const std::string of = " answers to the problems of " + record.problems;
  const std::string count =
      std::to_string(record.solved()) + " of " + std::to_string(record.planned()) + of;
  if (fault) return "Ended early, after " + count + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + count + "; what was measured is saved, --resume goes on.";
  }
  const std::string part =
      record.shard.is_whole() ? "" : "Shard " + shard_name(record.shard) + ": ";
  if (refused > 0) {
    return part + "Failed: the independent check refuses " + std::to_string(refused) + " of " +
           count + ".";
  }
  if (record.solved() < record.planned()) return part + "Incomplete: " + count + ".";
  if (!unmet.empty()) return part + "Failed: " + unmet + ".";
  const PlannerRecord* least = nullptr;
  const auto share_solved = [](const PlannerRecord& planner) {
    return static_cast<double>(std::ranges::count_if(planner.solves, &SetSolve::is_solved)) /
           static_cast<double>(std::max<std::size_t>(1, planner.solves.size()));
  };
  for (const PlannerRecord& planner : record.planners) {
    if (least == nullptr || share_solved(planner) < share_solved(*least)) least = &planner;
  }
  if (least != nullptr && share_solved(*least) < 1.0) {
    return part + "Measured: " + std::to_string(record.solved()) + of +
           ", none refused by the independent check; " + least->name + " solved the least, " +
           format("%.3g %%", 100.0 * share_solved(*least)) + ".";
  }
  return part + "Success: " + std::to_string(record.solved()) + of +
         ", none refused by the independent check.";
}

constexpr double kWidth = 900.0;
constexpr double kLegendRow = 20.0;
constexpr double kLegendLeft = 58.0;
constexpr double kLeastTime_ms = 1e-3;  // a logarithm needs one
constexpr std::array kColours = {palette::kBlue,      palette::kOrange, palette::kGreen,
                                 palette::kVermilion, palette::kPurple, palette::kSky,
                                 palette::kBlack};

/// Colours come again with other dashes.
Stroke stroke_of(std::size_t planner) {
  const std::vector<std::vector<double>> dashes = {{}, {6.0, 3.0}, {2.0, 3.0}};
  return {kColours[planner % kColours.size()], 1.8,
          dashes[planner / kColours.size() % dashes.size()]};
}

double log_ms(double time_ms) { return std::log10(std::max(time_ms, kLeastTime_ms)); }

/// From the fastest answer of all to the deadline.
Range time_range(const PlannerBenchmarkRecord& record) {
  Range range{log_ms(1e3 * record.deadline_s), log_ms(1e3 * record.deadline_s)};
  for (const PlannerRecord& planner : record.planners) {
    for (const SetSolve& solve : planner.solves) {
      if (solve.is_solved()) range.include(log_ms(solve.first_ms()));
    }
  }
  return range.padded(0.03);
}

/// Which share of the answers to a family's problems (all for an empty name) is there by a time:
/// a step up at each first valid answer.
void draw_success(Axes& axes, const PlannerRecord& planner, const std::string& family,
                  const Stroke& stroke) {
  const auto solves = those_of(planner.solves, [&](const SetSolve& solve) {
    return family.empty() || solve.family == family;
  });
  const auto solved = those_of(solves, &SetSolve::is_solved);
  if (solves.empty()) return;
  axes.shares(values_of(solved, [](const SetSolve& solve) { return log_ms(solve.first_ms()); }),
              solves.size(), stroke);
}

/// A panel for each family (an empty name: all problems), with a curve for each planner.
Figure success_figure(const PlannerBenchmarkRecord& record,
                      const std::vector<std::string>& families, double panel_width,
                      double panel_height, std::string file, std::string caption) {
  const auto columns = static_cast<std::size_t>(kWidth / panel_width);
  const double height =
      panel_height * static_cast<double>((families.size() + columns - 1) / columns);
  // Legend rows enough for three planners each, which any names leave room for.
  const double legend_rows = 1.0 + std::ceil(static_cast<double>(record.planners.size()) / 3.0);
  Figure figure{std::move(file), std::move(caption),
                Canvas(kWidth, height + kLegendRow * legend_rows)};
  const Range range = time_range(record);
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Area area{panel_width * static_cast<double>(f % columns),
                    panel_height * static_cast<double>(f / columns), panel_width, panel_height};
    const std::string title = families[f].empty() ? "Success against time" : families[f];
    Axes axes(figure.canvas, area, range, {0.0, 1.02}, {title, "time [ms]", "share solved", true});
    axes.grid();
    for (std::size_t p = 0; p < record.planners.size(); ++p) {
      draw_success(axes, record.planners[p], families[f], stroke_of(p));
    }
    axes.finish();
  }
  std::vector<LegendEntry> legend;
  for (std::size_t p = 0; p < record.planners.size(); ++p) {
    legend.push_back({record.planners[p].name, LegendEntry::Mark::kLine, stroke_of(p)});
  }
  draw_legend(figure.canvas, {kLegendLeft, height}, kWidth - kLegendLeft, legend);
  return figure;
}

Result<std::string> planners_body(const Json& summary, ResultsReader&,
                                  const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += "<h2>All problems</h2>\n" + planner_rows().html(at(summary, "/planners"));
  const auto record = SIDESTEP_TRY(read_planner_record(run / "results.sqlite"));
  html += SIDESTEP_TRY(figure_section(planner_figures(record), run));
  return html + "<h2>Family by family</h2>\n" + planner_rows().html(at(summary, "/families"));
}

}  // namespace

Parameters<PlannerExpectation> PlannerExpectation::parameters() {
  using E = PlannerExpectation;
  return Parameters<E>()
      .add("solved_share_1s", &E::solved_share_1s,
           "Least share of the problems that it solves within 1 s, by the independent check.",
           {.min = 0.0, .max = 1.0})
      .add("solved_share_5s", &E::solved_share_5s, "The same within 5 s.", {.min = 0.0, .max = 1.0})
      .add("first_p50_ms", &E::first_p50_ms,
           "Most that the median time until the first answer may be, of what is solved.",
           {.unit = "ms", .min = 0.0})
      .add("first_p95_ms", &E::first_p95_ms, "Most that 95 % of these times may be.",
           {.unit = "ms", .min = 0.0});
}

ExperimentOutcome summarise_planners(const PlannerBenchmarkRecord& record, bool interrupted,
                                     const std::optional<Error>& fault) {
  const bool complete = record.solved() == record.planned();
  Json planners = Json::array();
  std::ptrdiff_t refused = 0;
  std::string unmet;
  for (const PlannerRecord& planner : record.planners) {
    planners.push_back(planner_rows().row({planner, "all", planner.solves}));
    refused += planners.back()["refused_by_check"].get<std::ptrdiff_t>();
    if (!complete || !record.shard.is_whole()) continue;
    const std::string its = unmet_expectation(planner, planners.back());
    if (!its.empty()) unmet += (unmet.empty() ? "" : "; ") + its;
  }
  const Json families = family_rows(record);
  ExperimentOutcome outcome;
  outcome.fault = fault;
  outcome.interrupted = interrupted && !complete;
  outcome.success = complete && !fault && refused == 0 && unmet.empty();
  outcome.verdict = verdict_text(record, outcome.interrupted, refused, unmet, fault);
  Json rows = planners;
  for (const Json& family : families) rows.push_back(family);
  outcome.table = planner_rows().text(rows);
  outcome.table_csv = planner_rows().csv(rows);
  outcome.summary_json = summary_text(record.provenance, "planner_benchmark", outcome,
                                      {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
                                       {"complete", complete},
                                       {"shard", shard_json(record.shard)},
                                       {"unmet", unmet},
                                       {"problems_file", record.problems},
                                       {"robot", record.robot},
                                       {"deadline_s", record.deadline_s},
                                       {"seeds", record.seeds},
                                       {"planners", planners},
                                       {"families", families},
                                       {"time", time_json(record)}});
  return outcome;
}

std::vector<Figure> planner_figures(const PlannerBenchmarkRecord& record) {
  std::vector<Figure> figures;
  if (record.solved() == 0) return figures;
  figures.push_back(success_figure(record, {""}, kWidth, 400.0, "planner_success",
                                   "Share of all problems with a first answer, accepted by the "
                                   "independent check, within a time."));
  figures.push_back(success_figure(record, families_of(record), 300.0, 240.0, "planner_families",
                                   "Times until the first accepted answer, family by family, as "
                                   "cumulative shares of the family's problems."));
  return figures;
}

const report::RunReport& planner_report() {
  static const report::RunReport kReport = {.body = &planners_body,
                                            .columns = &planner_rows(),
                                            .pictures = {"planner_"},
                                            .files = {kOmplDatabase}};
  return kReport;
}

}  // namespace sidestep
