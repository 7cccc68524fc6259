#include "study_summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include <nlohmann/json.hpp>

#include <sidestep/core/seed.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>

namespace sidestep {
namespace {

bool free_in(const ProblemOutcome& problem, std::size_t kind) {
  return problem.fields[kind].collision_free;
}

/// A number of a problem; nothing where the problem has none.
using NumberOf = std::function<std::optional<double>(const ProblemOutcome&)>;

/// The mean of a quantity with its interval by drawing scenes; `name` seeds the draws.
MeanWithInterval mean_of(const StudyRobotRows& robot, const ComparisonOptions& options,
                         const std::string& name, const NumberOf& quantity) {
  std::vector<double> values, sums, counts;
  std::int64_t scene = -1;
  for (const ProblemOutcome& problem : robot.problems) {
    if (robot.scene_of(problem) != scene) {
      scene = robot.scene_of(problem);
      sums.push_back(0.0);
      counts.push_back(0.0);
    }
    const std::optional<double> value = quantity(problem);
    if (!value) continue;
    values.push_back(*value);
    sums.back() += *value;
    counts.back() += 1.0;
  }
  const std::uint64_t seed = derive_seed(options.seed, "bootstrap/" + robot.name + "/" + name);
  return {statistics_of(values), std::ssize(values),
          bootstrap_ratio(sums, counts, options.bootstrap_samples, options.confidence, seed)};
}

/// A number of a problem where `applies` to it.
NumberOf where(bool (ProblemOutcome::*applies)() const noexcept, auto value) {
  return [=](const ProblemOutcome& problem) -> std::optional<double> {
    if (!(problem.*applies)()) return std::nullopt;
    return value(problem);
  };
}

void count_outcomes(const StudyRobotRows& robot, RobotComparison& result) {
  for (const ProblemOutcome& problem : robot.problems) {
    ++result.problems;
    if (!problem.start_free || !problem.goal_free) ++result.in_collision;
    if (!problem.is_attempted()) {
      ++result.skipped;
      continue;
    }
    const bool plain = free_in(problem, kUnsigned), sign = free_in(problem, kSigned);
    ++(plain && sign ? result.both
       : plain       ? result.only_unsigned
       : sign        ? result.only_signed
                     : result.neither);
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      FieldComparison& field = result.fields[kind];
      ++field.attempted;
      if (free_in(problem, kind)) ++field.collision_free;
      ++field.ended[static_cast<std::size_t>(problem.fields[kind].status)];
      field.solve_s += 1e-3 * problem.fields[kind].solve_ms;
      field.check_s += 1e-3 * problem.fields[kind].check_ms;
    }
  }
}

void compare_field(const StudyRobotRows& robot, const ComparisonOptions& options, std::size_t kind,
                   RobotComparison& result) {
  FieldComparison& field = result.fields[kind];
  field.failures = kind == kUnsigned ? result.only_signed : result.only_unsigned;
  field.failure_share = result.solvable() > 0 ? static_cast<double>(field.failures) /
                                                    static_cast<double>(result.solvable())
                                              : std::numeric_limits<double>::quiet_NaN();
  field.failure_interval = wilson_interval(field.failures, result.solvable(), options.confidence);
  const auto mean = [&](const char* name, auto member, auto applies) {
    return mean_of(robot, options, name, where(applies, [=](const ProblemOutcome& problem) {
                     return static_cast<double>(problem.fields[kind].*member);
                   }));
  };
  using F = FieldOutcome;
  using P = ProblemOutcome;
  field.iterations = mean("iterations", &F::iterations, &P::is_attempted);
  field.iterations_solvable = mean("iterations_solvable", &F::iterations, &P::is_solvable);
  field.steps = mean("steps", &F::steps, &P::is_attempted);
  field.valid_cost = mean("valid_cost", &F::cost, &P::is_solved_by_both);
  const auto attempted = those_of(robot.problems, &P::is_attempted);
  field.solve_ms =
      statistics_of(values_of(attempted, [=](const P& p) { return p.fields[kind].solve_ms; }));
  field.check_ms =
      statistics_of(values_of(attempted, [=](const P& p) { return p.fields[kind].check_ms; }));
}

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

std::string number(const Json& json, const char* pointer) {
  return report::cell(report::at(json, pointer), "%.3g");
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
            number(robot, "/unsigned/failure_percent") + " / " +
            number(robot, "/signed/failure_percent") + " %";
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

RobotComparison compare_fields(const StudyRobotRows& robot, const ComparisonOptions& options) {
  using F = FieldOutcome;
  using P = ProblemOutcome;
  RobotComparison result;
  count_outcomes(robot, result);
  for (const std::size_t kind : {kUnsigned, kSigned}) compare_field(robot, options, kind, result);
  const auto mean_difference = [&](const char* name, auto value, auto applies) {
    return mean_of(robot, options, name, where(applies, [=](const P& problem) {
                     return static_cast<double>(std::invoke(value, problem.fields[kSigned])) -
                            static_cast<double>(std::invoke(value, problem.fields[kUnsigned]));
                   }));
  };
  const MeanWithInterval failure = mean_difference(
      "failure_difference", [](const F& field) { return !field.collision_free; }, &P::is_solvable);
  result.failure_difference =
      failure.count > 0 ? failure.statistics.mean : std::numeric_limits<double>::quiet_NaN();
  result.failure_difference_interval = failure.interval;
  result.iterations_difference =
      mean_difference("iterations_difference", &F::iterations, &P::is_attempted);
  result.cost_difference = mean_difference("cost_difference", &F::cost, &P::is_solved_by_both);
  return result;
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
  const Json shard = study.shard.is_whole()
                         ? Json(nullptr)
                         : Json{{"index", study.shard.index + 1}, {"count", study.shard.count}};
  const Json particulars = {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
                            {"complete", complete},
                            {"shard", shard},
                            {"confidence", study.confidence},
                            {"published_as", study.published_as},
                            {"robots", robots},
                            {"time", time_json(study, comparisons)}};
  show_study(particulars, outcome);
  outcome.summary_json = summary_text(study.provenance, "field_study", outcome, particulars);
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
