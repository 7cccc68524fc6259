#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>

#include <sidestep/core/index.hpp>
#include <sidestep/report/chart.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>

#include "study_parts.hpp"

namespace sidestep {
namespace {

using namespace report;

constexpr double kPanelWidth = 360.0;
constexpr double kPanelHeight = 280.0;
constexpr double kLegend = 26.0;
constexpr int kSizeBins = 6;
constexpr int kCostBins = 40;
/// Iterations beyond this share of all solves go into the last bin.
constexpr double kShownIterations = 0.995;
/// Points of a scatter plot; more hide each other.
constexpr std::size_t kMostPoints = 4000;

const std::array<Colour, 2> kColours = {palette::kBlue, palette::kOrange};

double log_cost(const ProblemOutcome& problem, std::size_t kind) {
  return std::log10(std::max(problem.fields[kind].cost, 1e-9));
}

Stroke stroke_of(std::size_t kind) {
  return {kColours[kind], 2.0,
          kind == kSigned ? std::vector<double>{4.0, 3.0} : std::vector<double>{}};
}

/// One panel a robot, which `draw(canvas, area, robot)` draws, and the legend of both fields.
template <class Draw>
Figure panels_figure(const StudyRecord& study, std::string file, std::string caption,
                     bool with_legend, Draw draw) {
  Figure figure{std::move(file), std::move(caption),
                Canvas(kPanelWidth * static_cast<double>(study.robots.size()),
                       kPanelHeight + (with_legend ? kLegend : 0.0))};
  Area area{0.0, 0.0, kPanelWidth, kPanelHeight};
  for (const StudyRobotRows& robot : study.robots) {
    draw(figure.canvas, area, robot);
    area.x += kPanelWidth;
  }
  if (with_legend) {
    draw_legend(figure.canvas, {58.0, kPanelHeight + 8.0}, figure.canvas.width(),
                {{"unsigned", LegendEntry::Mark::kLine, stroke_of(kUnsigned)},
                 {"signed", LegendEntry::Mark::kLine, stroke_of(kSigned)}});
  }
  return figure;
}

/// Failures among the solvable problems of scenes of about one size.
struct SizeBin {
  double size_m = 0.0;
  std::int64_t solvable = 0;
  std::array<std::int64_t, 2> failures{};
};

std::vector<SizeBin> size_bins(const StudyRobotRows& robot) {
  double largest_m = 1e-9;
  std::map<std::int64_t, double> size_of;
  for (const SceneRow& scene : robot.drawn) {
    size_of[scene.scene] = scene.mean_side_m;
    largest_m = std::max(largest_m, scene.mean_side_m);
  }
  std::vector<SizeBin> bins(kSizeBins);
  const double width = largest_m / kSizeBins;
  for (int b = 0; b < kSizeBins; ++b) bins[idx(b)].size_m = (b + 0.5) * width;
  for (const ProblemOutcome& problem : robot.problems) {
    if (!problem.is_solvable()) continue;
    const auto index = static_cast<int>(size_of[robot.scene_of(problem)] / width);
    SizeBin& bin = bins[idx(std::clamp(index, 0, kSizeBins - 1))];
    ++bin.solvable;
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      if (!problem.fields[kind].collision_free) ++bin.failures[kind];
    }
  }
  std::erase_if(bins, [](const SizeBin& bin) { return bin.solvable == 0; });
  return bins;
}

void draw_failures(Canvas& canvas, const Area& area, const StudyRobotRows& robot,
                   double confidence) {
  const std::vector<SizeBin> bins = size_bins(robot);
  Range x{0.0, 0.0}, y{0.0, 0.0};
  for (const SizeBin& bin : bins) {
    x.include(bin.size_m * 1.15);
    for (const std::int64_t failures : bin.failures) {
      y.include(105.0 * wilson_interval(failures, bin.solvable, confidence).upper);
    }
  }
  Axes axes(canvas, area, x.padded(0.0), y.padded(0.02),
            {robot.name, "mean side of the boxes [m]", "failures [%]"});
  axes.grid();
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    std::vector<double> sizes, shares;
    for (const SizeBin& bin : bins) {
      const double shift_m = (kind == kSigned ? 1.0 : -1.0) * 0.008 * x.upper;
      const Interval interval = wilson_interval(bin.failures[kind], bin.solvable, confidence);
      axes.line({bin.size_m + shift_m, bin.size_m + shift_m},
                {100.0 * interval.lower, 100.0 * interval.upper}, {kColours[kind], 1.2, {}});
      sizes.push_back(bin.size_m + shift_m);
      shares.push_back(100.0 * static_cast<double>(bin.failures[kind]) /
                       static_cast<double>(bin.solvable));
    }
    axes.line(sizes, shares, stroke_of(kind));
  }
  axes.finish();
}

/// A histogram as the outline of its bars: shares of all values, in percent.
struct Outline {
  std::vector<double> x;
  std::vector<double> percent;
};

Outline histogram(const std::vector<double>& values, double lower, double width, int bins) {
  std::vector<double> counts(static_cast<std::size_t>(bins), 0.0);
  for (const double value : values) {
    const double bin = std::floor((value - lower) / width);
    counts[idx(std::clamp(bin, 0.0, bins - 1.0))] += 1.0;
  }
  Outline outline;
  for (int b = 0; b < bins; ++b) {
    const double percent =
        values.empty() ? 0.0 : 100.0 * counts[idx(b)] / static_cast<double>(values.size());
    for (const double edge : {0.0, 1.0}) {
      outline.x.push_back(lower + (b + edge) * width);
      outline.percent.push_back(percent);
    }
  }
  return outline;
}

void draw_histograms(Canvas& canvas, const Area& area, const std::array<Outline, 2>& shown,
                     const Axes::Labels& labels) {
  Range y{0.0, 1.0};
  for (const Outline& outline : shown) {
    for (const double percent : outline.percent) y.include(1.05 * percent);
  }
  Axes axes(canvas, area, {shown[0].x.front(), shown[0].x.back()}, y, labels);
  axes.grid();
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    axes.line(shown[kind].x, shown[kind].percent, stroke_of(kind));
  }
  axes.finish();
}

/// Logarithms of the costs of problems that both fields solve.
std::vector<double> log_costs(const StudyRobotRows& robot, std::size_t kind) {
  return values_of(those_of(robot.problems, &ProblemOutcome::is_solved_by_both),
                   [=](const ProblemOutcome& problem) { return log_cost(problem, kind); });
}

std::array<Outline, 2> iterations_of(const StudyRobotRows& robot) {
  std::array<std::vector<double>, 2> values;
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    values[kind] = values_of(those_of(robot.problems, &ProblemOutcome::is_attempted),
                             [=](const auto& problem) { return problem.fields[kind].iterations; });
  }
  const double most = std::max({5.0, percentile(values[kUnsigned], kShownIterations),
                                percentile(values[kSigned], kShownIterations)});
  const int bins = static_cast<int>(std::min(most, 50.0)) + 1;
  const double width = std::max(1.0, std::ceil(most / bins));
  return {histogram(values[kUnsigned], 0.0, width, bins),
          histogram(values[kSigned], 0.0, width, bins)};
}

Range cost_range(const StudyRobotRows& robot) {
  std::vector<double> costs = log_costs(robot, kUnsigned);
  std::ranges::copy(log_costs(robot, kSigned), std::back_inserter(costs));
  if (costs.empty()) return {0.0, 1.0};
  const auto [least, most] = std::ranges::minmax(costs);
  return Range{least, most}.padded(0.02);
}

std::array<Outline, 2> costs_of(const StudyRobotRows& robot) {
  const Range range = cost_range(robot);
  const auto of_field = [&](std::size_t kind) {
    return histogram(log_costs(robot, kind), range.lower, (range.upper - range.lower) / kCostBins,
                     kCostBins);
  };
  return {of_field(kUnsigned), of_field(kSigned)};
}

void draw_scatter(Canvas& canvas, const Area& area, const StudyRobotRows& robot) {
  const Range range = cost_range(robot);
  Axes axes(canvas, area, range, range, {robot.name, "log10 of the cost, unsigned", "signed"});
  axes.grid();
  axes.line({range.lower, range.upper}, {range.lower, range.upper}, {palette::kGrey, 1.0, {}});
  const std::size_t stride = robot.problems.size() / kMostPoints + 1;
  for (std::size_t i = 0; i < robot.problems.size(); ++i) {
    const ProblemOutcome& problem = robot.problems[i];
    if (!problem.is_solved_by_both()) continue;
    // All that differ are drawn, of those that agree every n-th.
    const double plain = log_cost(problem, kUnsigned), sign = log_cost(problem, kSigned);
    if (std::abs(plain - sign) < 0.01 && i % stride != 0) continue;
    canvas.circle(axes.at(plain, sign), 1.6, palette::kPurple.with_alpha(0.45));
  }
  axes.finish();
}

/// A panel for each robot: failures against obstacle size, the distributions of iterations and of
/// valid costs, cost against cost.
std::vector<Figure> study_figures(const StudyRecord& study) {
  std::vector<Figure> figures;
  if (study.solved() == 0) return figures;
  figures.push_back(panels_figure(
      study, "study_failures",
      "Failures among the problems that at least one field solves, by the size of the obstacles, "
      "with Wilson's intervals.",
      true, [&](Canvas& canvas, const Area& area, const StudyRobotRows& robot) {
        draw_failures(canvas, area, robot, study.confidence);
      }));
  figures.push_back(panels_figure(
      study, "study_iterations", "Iterations of every solve; the last bin holds all beyond it.",
      true, [](Canvas& canvas, const Area& area, const StudyRobotRows& robot) {
        draw_histograms(canvas, area, iterations_of(robot),
                        {robot.name, "iterations", "share of solves [%]"});
      }));
  figures.push_back(panels_figure(
      study, "study_costs", "Costs of trajectories, where both fields lead to collision-free ones.",
      true, [](Canvas& canvas, const Area& area, const StudyRobotRows& robot) {
        draw_histograms(canvas, area, costs_of(robot),
                        {robot.name, "log10 of the cost", "share of problems [%]"});
      }));
  figures.push_back(panels_figure(study, "study_scatter",
                                  "The cost in the signed field against that in the unsigned one, "
                                  "problem by problem, where both are collision-free.",
                                  false, &draw_scatter));
  return figures;
}

/// Each robot with each field: rows of table.csv, made of `robots` in summary.json.
Json study_fields(const Json& summary) {
  Json fields = Json::array();
  for (const Json& robot : at(summary, "/robots")) {
    for (const char* kind : kFieldNames) {
      Json& row = fields.emplace_back(robot);
      row.update(robot.at(kind));
      row["robot"] = robot.at("name");
      row["field"] = kind;
    }
  }
  return fields;
}

const ResultColumns& study_columns() {
  static const auto kColumns = [] {
    ResultColumns columns("");
    const auto mean = [&](const std::string& key, const std::string& meaning, const char* heading,
                          const char* pattern) {
      columns.declare(key + ".mean", meaning,
                      {.heading = heading, .pattern = pattern, .compared = true});
      columns.declare(key + ".sd", meaning + " Standard deviation.");
      columns.declare(key + ".ci.0", meaning + " Interval of the mean, from.");
      columns.declare(key + ".ci.1", meaning + " Interval of the mean, to.");
    };
    columns.declare("robot", "Name of the robot.", {.heading = "robot", .compared = true});
    columns.declare("field", "Kind of field: `unsigned` or `signed`.",
                    {.heading = "field", .compared = true});
    columns.begin_table("Problems");
    columns.declare("dof", "Joints that are planned.", {.heading = "joints", .page_only = true});
    columns.declare("spheres", "Its spheres.", {.heading = "spheres", .page_only = true});
    columns.declare("boxes_per_scene", "Boxes in each scene.",
                    {.heading = "boxes", .page_only = true});
    columns.declare("resolution_m", "Edge of a voxel.",
                    {.heading = "voxel", .pattern = "%g m", .page_only = true});
    const auto count = [&](const char* key, const char* meaning, const char* heading,
                           bool compared = false) {
      columns.declare(key, meaning, {.heading = heading, .pattern = "%.0f", .compared = compared});
    };
    count("problems", "Problems that were looked at.", "problems", true);
    count("start_or_goal_in_collision", "Of these, with a start or goal in collision.",
          "start or goal collides");
    count("solvable", "Solved collision-free with at least one of the fields.", "solvable", true);
    count("solved_by_both", "Solved with both.", "solved by both");
    count("only_unsigned", "Solved with the unsigned field alone.", "only unsigned");
    count("only_signed", "Solved with the signed field alone.", "only signed");
    count("neither", "Solved with neither.", "neither");
    columns.begin_table("Outcomes and times");
    count("collision_free", "Problems solved collision-free with this field.", "solved");
    count("failures", "Solvable problems that are not.", "failures");
    columns.declare("failure_percent", "Their share of the solvable problems, in percent.",
                    {.heading = "share", .pattern = "%.3f %%", .compared = true});
    columns.declare("failure_percent_ci.0", "Wilson's interval of it, from.");
    columns.declare("failure_percent_ci.1", "Wilson's interval of it, to.");
    mean("iterations", "Iterations of every solve.", "iterations", "%.2f");
    mean("steps", "Steps that were tried in every solve.", "steps tried", "%.2f");
    columns.declare("valid_cost.count", "Problems that both fields solve.");
    mean("valid_cost", "Final cost of these.", "cost", "%.4g");
    columns.declare("valid_cost.p50", "Its median.");
    const Shown times{.heading = "solve", .pattern = "%.3f ms", .compared = true};
    columns.declare_statistics("solve_ms.", "Wall time of a solve.", {"mean", "p50", "p95"}, times);
    columns.declare_statistics("check_ms.", "Wall time of its check.", {"mean"},
                               {.heading = "check", .pattern = "%.3f ms"});
    return columns;
  }();
  return kColumns;
}

/// One quantity of the paper's table: where it stands, and how it is written.
struct Quantity {
  const char* name;
  std::string key;      ///< Of a field, of `published` and of `difference`.
  const char* pattern;  ///< Of values.
  bool is_mean;         ///< With a standard deviation; else a share in percent.
  const char* unit = "";
};

/// The quantity in one part of a robot's row; the difference stands without standard deviation.
std::string value_cell(const Json& robot, const std::string& part, const Quantity& what,
                       const char* pattern) {
  const Json value = at(robot, ("/" + part + "/" + what.key).c_str());
  const std::string text = cell(what.is_mean ? at(value, "/mean") : value, pattern);
  if (text == "-") return text;
  const bool has_sd = what.is_mean && part != "difference";
  return text + (has_sd ? " ± " + cell(at(value, "/sd"), pattern) : "") + what.unit;
}

std::string interval_cell(const Json& robot, const std::string& part, const Quantity& what) {
  const std::string of = "/" + part + "/" + what.key + (what.is_mean ? "/ci" : "_ci");
  const Json ci = at(robot, of.c_str());
  const std::string lower = cell(at(ci, "/0"), what.pattern);
  return lower == "-" ? "-" : "[" + lower + ", " + cell(at(ci, "/1"), what.pattern) + "]";
}

/// One quantity of one robot: printed figures, then ours, each with its interval, in one cell or in
/// two, and the difference.
Row quantity_row(const Json& robot, const Quantity& what, bool in_one_cell) {
  Row row{cell(at(robot, "/name")), what.name};
  for (const char* part : {"published/unsigned", "published/signed"}) {
    row.push_back(value_cell(robot, part, what, "%g"));
  }
  for (const char* part : {"unsigned", "signed", "difference"}) {
    row.push_back(value_cell(robot, part, what, what.pattern));
    const std::string interval = interval_cell(robot, part, what);
    if (!in_one_cell) row.push_back(interval);
    if (in_one_cell && interval != "-") row.back() += " " + interval;
  }
  return row;
}

std::string outcomes_section(const Json& summary) {
  const std::string published = cell(at(summary, "/published_as"));
  const std::string interval_head =
      cell(Json(100.0 * at(summary, "/confidence").get<double>()), "%g %% interval");
  std::vector<Row> rows;
  for (const Json& robot : at(summary, "/robots")) {
    for (const Quantity& what :
         {Quantity{"failures", "failure_percent", "%.3f", false, " %"},
          Quantity{"iterations", "iterations", "%.2f", true},
          Quantity{"iterations, solvable problems", "iterations_solvable", "%.2f", true},
          Quantity{"valid cost", "valid_cost", "%.4g", true}}) {
      rows.push_back(quantity_row(robot, what, false));
    }
  }
  return "<h2>Unsigned against signed fields</h2>\n" +
         html_table({"robot", "", published + ", unsigned", "signed", "unsigned", interval_head,
                     "signed", interval_head, "signed − unsigned", interval_head},
                    rows) +
         "<p>Failures: problems that a field fails to solve collision-free, among those that at "
         "least one of the two solves; Wilson's interval. Iterations: of every solve. Valid cost: "
         "of problems that both solve. Intervals of means and differences: percentile bootstrap "
         "over scenes.</p>\n";
}

std::string time_section(const Json& summary) {
  return "<h2>Time</h2>\n" + html_table({{"wall", "/wall_s", "%.1f s"},
                                         {"of all cores", "/cpu_s", "%.1f s"},
                                         {"in the optimiser, all threads", "/solve_s", "%.1f s"},
                                         {"in the check", "/check_s", "%.1f s"},
                                         {"making fields", "/field_s", "%.1f s"}},
                                        Json::array({at(summary, "/time")}));
}

Result<std::string> study_body(const Json& summary, ResultsReader&,
                               const std::filesystem::path& run) {
  std::string html;
  if (const std::string fault = cell(at(summary, "/fault")); fault != "-") {
    html += "<p class=\"verdict failure\">" + escape_html(fault) + "</p>\n";
  }
  html += outcomes_section(summary) + study_columns().html(study_fields(summary));
  const auto study = SIDESTEP_TRY(read_study(run / "results.sqlite"));
  const auto figures = SIDESTEP_TRY(figure_section(study_figures(study), run));
  return html + figures + time_section(summary);
}

}  // namespace

void show_study(const Json& summary, ExperimentOutcome& outcome) {
  const std::string interval = format(" [%g %%]", 100.0 * at(summary, "/confidence").get<double>());
  TextTable table({"robot", "", cell(at(summary, "/published_as")) + " USDF", "SDF",
                   "USDF" + interval, "SDF" + interval, "SDF - USDF" + interval});
  for (const Json& robot : at(summary, "/robots")) {
    for (const Quantity& what : {Quantity{"failures, %", "failure_percent", "%.3f", false},
                                 Quantity{"iterations", "iterations", "%.2f", true},
                                 Quantity{"valid cost", "valid_cost", "%.4g", true}}) {
      table.add(quantity_row(robot, what, true));
    }
  }
  const Json fields = study_fields(summary);
  outcome.table = table.text() + "\n" + study_columns().text(fields);
  outcome.table_csv = study_columns().csv(fields);
}

const report::RunReport& study_report() {
  static const report::RunReport kReport = {.body = &study_body,
                                            .columns = &study_columns(),
                                            .compared_rows = &study_fields,
                                            .pictures = {"study_"}};
  return kReport;
}

}  // namespace sidestep
