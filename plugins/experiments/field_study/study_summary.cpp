#include "study_parts.hpp"

#include <algorithm>
#include <functional>

#include <nlohmann/json.hpp>

#include <sidestep/core/seed.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/summary.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<SolveStatus, 5> kStatuses = {
    SolveStatus::kConverged, SolveStatus::kIterationLimit, SolveStatus::kDeadline,
    SolveStatus::kNoPath, SolveStatus::kFailed};

/// A mean with the interval that drawing other scenes would leave it in.
struct MeanWithInterval {
  Statistics statistics;
  std::int64_t count = 0;
  Interval interval;
};

/// The mean of a quantity of the problems that it applies to, with its interval by drawing scenes;
/// `name` seeds the draws.
template <class Value>
MeanWithInterval mean_of(const StudyRecord& study, const StudyRobotRows& robot, const char* name,
                         bool (ProblemOutcome::*applies)() const noexcept, Value value_of) {
  std::vector<double> values, sums, counts;
  std::int64_t scene = -1;
  for (const ProblemOutcome& problem : robot.problems) {
    if (robot.scene_of(problem) != scene) {
      scene = robot.scene_of(problem);
      sums.push_back(0.0);
      counts.push_back(0.0);
    }
    if (!(problem.*applies)()) continue;
    values.push_back(value_of(problem));
    sums.back() += values.back();
    counts.back() += 1.0;
  }
  const std::uint64_t seed =
      derive_seed(study.provenance.seed, "bootstrap/" + robot.name + "/" + name);
  return {statistics_of(values), std::ssize(values),
          bootstrap_ratio(sums, counts, study.bootstrap_samples, study.confidence, seed)};
}

Json interval_json(const Interval& interval, double scale = 1.0) {
  return Json::array({scale * interval.lower, scale * interval.upper});
}

/// Null where there are none to be a part of.
Json percent_of(std::int64_t part, std::int64_t all) {
  if (all == 0) return nullptr;
  return 100.0 * (static_cast<double>(part) / static_cast<double>(all));
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

/// One field over all problems of a robot. Its failures are the solvable problems that are not
/// collision-free in it; their interval is Wilson's.
Json field_json(const StudyRecord& study, const StudyRobotRows& robot, std::size_t kind) {
  using P = ProblemOutcome;
  using F = FieldOutcome;
  const auto attempted = those_of(robot.problems, &P::is_attempted);
  const auto with = [&](auto member, auto value) {
    return std::ranges::count_if(
        attempted, [=](const P& problem) { return problem.fields[kind].*member == value; });
  };
  const auto solvable = std::ranges::count_if(attempted, &P::is_solvable);
  const auto failures = solvable - with(&F::collision_free, true);
  const Interval interval = wilson_interval(failures, solvable, study.confidence);
  Json ended = Json::object();
  for (const SolveStatus status : kStatuses) {
    ended[std::string(to_string(status))] = with(&F::status, status);
  }
  const auto mean = [&](const char* name, auto member, auto applies) {
    return mean_json(mean_of(study, robot, name, applies, [=](const P& problem) {
      return static_cast<double>(problem.fields[kind].*member);
    }));
  };
  const auto times = [&](auto member) {
    return times_json(statistics_of(
        values_of(attempted, [=](const P& problem) { return problem.fields[kind].*member; })));
  };
  return {{"attempted", attempted.size()},
          {"collision_free", with(&F::collision_free, true)},
          {"failures", failures},
          {"failure_percent", percent_of(failures, solvable)},
          {"failure_percent_ci", interval_json(interval, 100.0)},
          {"ended", ended},
          {"iterations", mean("iterations", &F::iterations, &P::is_attempted)},
          {"iterations_solvable", mean("iterations_solvable", &F::iterations, &P::is_solvable)},
          {"steps", mean("steps", &F::steps, &P::is_attempted)},
          {"valid_cost", mean("valid_cost", &F::cost, &P::is_solved_by_both)},
          {"solve_ms", times(&F::solve_ms)},
          {"check_ms", times(&F::check_ms)}};
}

/// Signed minus unsigned, with bootstrapped intervals over scenes.
Json difference_json(const StudyRecord& study, const StudyRobotRows& robot) {
  using P = ProblemOutcome;
  using F = FieldOutcome;
  const auto mean = [&](const char* name, auto value, auto applies) {
    return mean_of(study, robot, name, applies, [=](const P& problem) {
      return static_cast<double>(std::invoke(value, problem.fields[kSigned])) -
             static_cast<double>(std::invoke(value, problem.fields[kUnsigned]));
    });
  };
  const auto failure = mean(
      "failure_difference", [](const F& field) { return !field.collision_free; }, &P::is_solvable);
  return {
      {"failure_percent",
       failure.count > 0 ? Json(100.0 * failure.statistics.mean) : Json(nullptr)},
      {"failure_percent_ci", interval_json(failure.interval, 100.0)},
      {"iterations", mean_json(mean("iterations_difference", &F::iterations, &P::is_attempted))},
      {"valid_cost", mean_json(mean("cost_difference", &F::cost, &P::is_solved_by_both))}};
}

Json published_json(const PublishedOutcome& published) {
  return {{"failure_percent", published.failure_percent},
          {"iterations", {{"mean", published.iterations_mean}, {"sd", published.iterations_sd}}},
          {"valid_cost", {{"mean", published.cost_mean}, {"sd", published.cost_sd}}}};
}

Json time_json(const StudyRecord& study) {
  double wall_s = 0.0, cpu_s = 0.0, solve_s = 0.0, check_s = 0.0, field_s = 0.0;
  for (const RunSession& session : study.sessions) {
    wall_s += session.wall_s;
    cpu_s += session.cpu_s;
  }
  for (const StudyRobotRows& robot : study.robots) {
    for (const ProblemOutcome& problem : robot.problems) {
      solve_s += 1e-3 * (problem.fields[kUnsigned].solve_ms + problem.fields[kSigned].solve_ms);
      check_s += 1e-3 * (problem.fields[kUnsigned].check_ms + problem.fields[kSigned].check_ms);
    }
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

Json compare_fields(const StudyRecord& study, const StudyRobotRows& robot) {
  using P = ProblemOutcome;
  const auto count = [&](auto holds) { return std::ranges::count_if(robot.problems, holds); };
  const auto attempted = count(&P::is_attempted), solvable = count(&P::is_solvable);
  const auto both = count(&P::is_solved_by_both);
  const auto only = [&](std::size_t kind) {
    return count([=](const P& problem) { return problem.fields[kind].collision_free; }) - both;
  };
  const auto in_collision = count([](const P& p) { return !p.start_free || !p.goal_free; });
  Json json = {{"name", robot.name},
               {"dof", robot.dof},
               {"spheres", robot.spheres},
               {"states", robot.states},
               {"pairs", robot.pairs()},
               {"scenes", robot.scenes},
               {"boxes_per_scene", robot.boxes_per_scene},
               {"resolution_m", robot.resolution_m},
               {"planned", robot.planned},
               {"problems", robot.problems.size()},
               {"skipped", std::ssize(robot.problems) - attempted},
               {"start_or_goal_in_collision", in_collision},
               {"solvable", solvable},
               {"solved_by_both", both},
               {"only_unsigned", only(kUnsigned)},
               {"only_signed", only(kSigned)},
               {"neither", attempted - solvable}};
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    json[kFieldNames[kind]] = field_json(study, robot, kind);
  }
  json["difference"] = difference_json(study, robot);
  json["published"] = nullptr;
  if (robot.published) {
    json["published"] = {{"unsigned", published_json(robot.published->unsigned_field)},
                         {"signed", published_json(robot.published->signed_field)}};
  }
  return json;
}

Result<ExperimentOutcome> conclude_study(const std::filesystem::path& run, bool interrupted,
                                         const std::optional<Error>& fault) {
  const auto study = SIDESTEP_TRY(read_study(run / "results.sqlite"));
  Json robots = Json::array();
  for (const StudyRobotRows& robot : study.robots) {
    robots.push_back(compare_fields(study, robot));
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
                            {"time", time_json(study)}};
  show_study(particulars, outcome);
  outcome.summary_json = summary_text(study.provenance, "field_study", outcome, particulars);
  return outcome;
}

Result<ExperimentOutcome> merge_study(const std::vector<std::filesystem::path>& runs,
                                      const std::filesystem::path& out) {
  auto study = SIDESTEP_TRY(merged_record(runs, &read_study, &absorb_study));
  for (StudyRobotRows& robot : study.robots) robot.planned = robot.pairs() * robot.scenes;
  return conclude_whole(study, out, &record_whole_study, &conclude_study);
}

}  // namespace sidestep
