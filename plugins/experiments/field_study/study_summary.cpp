#include "study_summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include <sidestep/report/report_parts.hpp>
#include <sidestep/report/text_table.hpp>
#include <sidestep/results/json.hpp>
#include "study_comparison.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<SolveStatus, 5> kStatuses = {
    SolveStatus::kConverged, SolveStatus::kIterationLimit, SolveStatus::kDeadline,
    SolveStatus::kNoPath, SolveStatus::kFailed};

Json interval_json(const Interval& interval, double scale = 1.0) {
  return Json::array({scale * interval.lower, scale * interval.upper});
}

Json mean_json(const MeanWithInterval& mean) {
  if (mean.count == 0) {
    return {{"count", 0},    {"mean", nullptr}, {"sd", nullptr},
            {"ci", nullptr}, {"p50", nullptr},  {"p95", nullptr}};
  }
  return {{"count", mean.count},        {"mean", mean.statistics.mean},
          {"sd", mean.statistics.sd},   {"ci", interval_json(mean.interval)},
          {"p50", mean.statistics.p50}, {"p95", mean.statistics.p95}};
}

Json times_json(const Statistics& times) {
  return {{"mean", times.mean}, {"p50", times.p50}, {"p95", times.p95}, {"max", times.max}};
}

Json field_json(const FieldComparison& field) {
  Json ended = Json::object();
  for (const SolveStatus status : kStatuses) {
    ended[std::string(to_string(status))] = field.ended[static_cast<std::size_t>(status)];
  }
  return {{"attempted", field.attempted},
          {"collision_free", field.collision_free},
          {"failures", field.failures},
          {"failure_percent", 100.0 * field.failure_share},
          {"failure_percent_ci", interval_json(field.failure_interval, 100.0)},
          {"ended", ended},
          {"iterations", mean_json(field.iterations)},
          {"iterations_solvable", mean_json(field.iterations_solvable)},
          {"steps", mean_json(field.steps)},
          {"valid_cost", mean_json(field.valid_cost)},
          {"solve_ms", times_json(field.solve_ms)},
          {"check_ms", times_json(field.check_ms)}};
}

Json published_json(const PublishedOutcome& published) {
  return {{"failure_percent", published.failure_percent},
          {"iterations", {{"mean", published.iterations_mean}, {"sd", published.iterations_sd}}},
          {"valid_cost", {{"mean", published.cost_mean}, {"sd", published.cost_sd}}}};
}

Json robot_json(const StudyRobotRows& robot, const RobotComparison& comparison) {
  Json json = {{"name", robot.name},
               {"dof", robot.dof},
               {"spheres", robot.spheres},
               {"states", robot.states},
               {"pairs", robot.pairs()},
               {"scenes", robot.scenes},
               {"boxes_per_scene", robot.boxes_per_scene},
               {"resolution_m", robot.resolution_m},
               {"planned", robot.planned},
               {"problems", comparison.problems},
               {"skipped", comparison.skipped},
               {"start_or_goal_in_collision", comparison.in_collision},
               {"solvable", comparison.solvable()},
               {"solved_by_both", comparison.both},
               {"only_unsigned", comparison.only_unsigned},
               {"only_signed", comparison.only_signed},
               {"neither", comparison.neither}};
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    json[kFieldNames[kind]] = field_json(comparison.fields[kind]);
  }
  json["difference"] = {
      {"failure_percent", 100.0 * comparison.failure_difference},
      {"failure_percent_ci", interval_json(comparison.failure_difference_interval, 100.0)},
      {"iterations", mean_json(comparison.iterations_difference)},
      {"valid_cost", mean_json(comparison.cost_difference)}};
  json["published"] = nullptr;
  if (robot.published) {
    json["published"] = {{"unsigned", published_json(robot.published->unsigned_field)},
                         {"signed", published_json(robot.published->signed_field)}};
  }
  return json;
}

Json time_json(const StudyRecord& study, const std::vector<RobotComparison>& comparisons) {
  double wall_s = 0.0, cpu_s = 0.0, solve_s = 0.0, check_s = 0.0, field_s = 0.0;
  for (const RunSession& session : study.sessions) {
    wall_s += session.wall_s;
    cpu_s += session.cpu_s;
  }
  for (const RobotComparison& robot : comparisons) {
    for (const FieldComparison& field : robot.fields) {
      solve_s += field.solve_s;
      check_s += field.check_s;
    }
  }
  for (const StudyRobotRows& robot : study.robots) {
    for (const SceneRow& scene : robot.drawn) {
      field_s += 1e-3 * (scene.field_ms[kUnsigned] + scene.field_ms[kSigned]);
    }
  }
  return {{"sessions", study.sessions.size()},
          {"wall_s", wall_s},
          {"cpu_s", cpu_s},
          {"solve_s", solve_s},
          {"check_s", check_s},
          {"field_s", field_s}};
}

/// Each robot with each field.
Json fields_of(const Json& robots) {
  Json fields = Json::array();
  for (const Json& robot : robots) {
    for (const char* kind : kFieldNames) {
      Json& row = fields.emplace_back(robot);
      row.update(robot.at(kind));
      row["robot"] = robot.at("name");
      row["field"] = kind;
    }
  }
  return fields;
}

std::string number(const Json& json, const std::string& pointer, const char* pattern) {
  return report::cell(report::at(json, pointer.c_str()), pattern);
}

/// One quantity of the paper's table: where it stands, and how it is written.
struct Quantity {
  const char* name;
  std::string key;      ///< Of a field, of `published` and of `difference`.
  const char* pattern;  ///< Of values.
  bool is_mean;         ///< With a standard deviation; else a share in percent.
};

std::string published_cell(const Json& robot, const char* kind, const Quantity& what) {
  const std::string at = std::string("/published/") + kind + "/" + what.key;
  if (!what.is_mean) return number(robot, at, "%g");
  const std::string mean = number(robot, at + "/mean", "%g");
  return mean == "-" ? mean : mean + " ± " + number(robot, at + "/sd", "%g");
}

std::string interval_cell(const Json& json, const std::string& at, const char* pattern) {
  const std::string lower = number(json, at + "/0", pattern);
  if (lower == "-") return "";
  return " [" + lower + ", " + number(json, at + "/1", pattern) + "]";
}

std::string own_cell(const Json& robot, const std::string& at, const Quantity& what, bool with_sd) {
  const std::string base = "/" + at + "/" + what.key;
  if (!what.is_mean) {
    return number(robot, base, what.pattern) + interval_cell(robot, base + "_ci", what.pattern);
  }
  std::string text = number(robot, base + "/mean", what.pattern);
  if (text == "-") return text;
  if (with_sd) text += " ± " + number(robot, base + "/sd", what.pattern);
  return text + interval_cell(robot, base + "/ci", what.pattern);
}

std::string table_text(const Json& robots, const std::string& published_as, double confidence) {
  const std::string interval = format(" [%g %%]", 100.0 * confidence);
  TextTable table({"robot", "", published_as + " USDF", "SDF", "USDF" + interval, "SDF" + interval,
                   "SDF - USDF" + interval});
  const std::array<Quantity, 3> quantities = {{{"failures, %", "failure_percent", "%.3f", false},
                                               {"iterations", "iterations", "%.2f", true},
                                               {"valid cost", "valid_cost", "%.4g", true}}};
  for (const Json& robot : robots) {
    for (const Quantity& what : quantities) {
      table.add({robot.at("name").get<std::string>(), what.name,
                 published_cell(robot, "unsigned", what), published_cell(robot, "signed", what),
                 own_cell(robot, "unsigned", what, true), own_cell(robot, "signed", what, true),
                 own_cell(robot, "difference", what, false)});
    }
  }
  return table.text() + "\n" + study_columns().text(fields_of(robots));
}

std::string verdict_text(const StudyRecord& study, const Json& robots, bool interrupted,
                         const std::optional<Error>& fault) {
  const std::string solved =
      std::to_string(study.solved()) + " of " + std::to_string(study.planned()) + " problems";
  if (fault) return "Ended early, after " + solved + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + solved + "; what was solved is saved, --resume goes on.";
  }
  const std::string part = study.shard.is_whole() ? "" : "Shard " + shard_name(study.shard) + ": ";
  if (study.solved() < study.planned()) return part + "Incomplete: " + solved + ".";
  std::string text = part + "Success: " + solved + " in both fields; failures USDF / SDF:";
  for (const Json& robot : robots) {
    text += (&robot == &robots.front() ? " " : ", ") + robot.at("name").get<std::string>() + " " +
            number(robot, "/unsigned/failure_percent", "%.3g") + " / " +
            number(robot, "/signed/failure_percent", "%.3g") + " %";
  }
  return text + ".";
}

/// Moves what a part has found into the whole.
void absorb_study(StudyRecord& whole, StudyRecord part) {
  for (std::size_t r = 0; r < whole.robots.size(); ++r) {
    std::ranges::copy(part.robots[r].drawn, std::back_inserter(whole.robots[r].drawn));
    std::ranges::copy(part.robots[r].problems, std::back_inserter(whole.robots[r].problems));
  }
}

void record_whole_study(const StudyRecord& study, Recorder& recorder) {
  record_study(study, recorder);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    for (const SceneRow& scene : study.robots[r].drawn) record_scene(scene, r, recorder);
    for (const ProblemOutcome& problem : study.robots[r].problems) {
      record_problem(problem, r, recorder);
    }
  }
}

}  // namespace

Json study_fields(const Json& summary) { return fields_of(report::at(summary, "/robots")); }

const report::ResultColumns& study_columns() {
  static const auto kColumns = [] {
    report::ResultColumns columns("");
    const auto mean = [&](const std::string& key, const char* meaning, const char* heading,
                          const char* pattern) {
      columns.declare(key + ".mean", meaning,
                      {.heading = heading, .pattern = pattern, .compared = *heading != 0});
      columns.declare(key + ".sd", std::string(meaning) + " Standard deviation.");
      columns.declare(key + ".ci.0", std::string(meaning) + " Interval of the mean, from.");
      columns.declare(key + ".ci.1", std::string(meaning) + " Interval of the mean, to.");
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
    const report::Shown times{.heading = "solve", .pattern = "%.3f ms", .compared = true};
    columns.declare_statistics("solve_ms.", "Wall time of a solve.", {"mean", "p50", "p95"}, times);
    columns.declare_statistics("check_ms.", "Wall time of its check.", {"mean"},
                               {.heading = "check", .pattern = "%.3f ms"});
    return columns;
  }();
  return kColumns;
}

ExperimentOutcome summarise_study(const StudyRecord& study, bool interrupted,
                                  const std::optional<Error>& fault) {
  const ComparisonOptions options{study.confidence, study.bootstrap_samples, study.provenance.seed};
  std::vector<RobotComparison> comparisons;
  Json robots = Json::array();
  for (const StudyRobotRows& robot : study.robots) {
    comparisons.push_back(compare_fields(robot, options));
    robots.push_back(robot_json(robot, comparisons.back()));
  }
  const bool complete = study.solved() == study.planned();
  ExperimentOutcome outcome;
  outcome.fault = fault;
  outcome.interrupted = interrupted && !complete;
  outcome.success = complete && !fault;
  outcome.verdict = verdict_text(study, robots, outcome.interrupted, fault);
  outcome.table = table_text(robots, study.published_as, study.confidence);
  outcome.table_csv = study_columns().csv(fields_of(robots));
  const Json shard = study.shard.is_whole()
                         ? Json(nullptr)
                         : Json{{"index", study.shard.index + 1}, {"count", study.shard.count}};
  outcome.summary_json = summary_text(study.provenance, "field_study", outcome,
                                      {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
                                       {"complete", complete},
                                       {"shard", shard},
                                       {"confidence", study.confidence},
                                       {"published_as", study.published_as},
                                       {"robots", robots},
                                       {"time", time_json(study, comparisons)}});
  return outcome;
}

Result<ExperimentOutcome> conclude_study(const std::filesystem::path& run, bool interrupted,
                                         const std::optional<Error>& fault) {
  const auto study = SIDESTEP_TRY(read_study(run / "results.sqlite"));
  return summarise_study(study, interrupted, fault);
}

Result<ExperimentOutcome> merge_study(const std::vector<std::filesystem::path>& runs,
                                      const std::filesystem::path& out) {
  auto study = SIDESTEP_TRY(merged_record(runs, &read_study, &absorb_study));
  for (StudyRobotRows& robot : study.robots) robot.planned = robot.pairs() * robot.scenes;
  return conclude_whole(study, out, &record_whole_study, &conclude_study);
}

}  // namespace sidestep
