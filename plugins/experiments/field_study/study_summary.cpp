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

constexpr double kSkipped = -1.0;

std::string of_robot(const char* series, std::size_t robot) {
  return std::string(series) + "/" + std::to_string(robot);
}

StoredRow<StudyRecord> stored_study() {
  return StoredRow<StudyRecord>()
      .add("confidence", &StudyRecord::confidence)
      .add("bootstrap_samples", &StudyRecord::bootstrap_samples)
      .add("published_as", &StudyRecord::published_as)
      .add(
          "robots", [](const StudyRecord& study) { return study.robots.size(); },
          [](StudyRecord& study, std::size_t count) { study.robots.resize(count); });
}

StoredRow<PublishedOutcome> stored_published(const std::string& kind) {
  const std::string prefix = "published." + kind + ".";
  return StoredRow<PublishedOutcome>()
      .add(prefix + "failure_percent", &PublishedOutcome::failure_percent)
      .add(prefix + "iterations_mean", &PublishedOutcome::iterations_mean)
      .add(prefix + "iterations_sd", &PublishedOutcome::iterations_sd)
      .add(prefix + "cost_mean", &PublishedOutcome::cost_mean)
      .add(prefix + "cost_sd", &PublishedOutcome::cost_sd);
}

StoredRow<StudyRobotRows> stored_robot() {
  using Rows = StudyRobotRows;
  return StoredRow<Rows>()
      .add("name", &Rows::name)
      .add("dof", &Rows::dof)
      .add("spheres", &Rows::spheres)
      .add("states", &Rows::states)
      .add("scenes", &Rows::scenes)
      .add("boxes_per_scene", &Rows::boxes_per_scene)
      .add("resolution_m", &Rows::resolution_m)
      .add("planned", &Rows::planned)
      .add(
          "has_published", [](const Rows& rows) { return rows.published.has_value(); },
          [](Rows& rows, bool has) {
            if (has) rows.published.emplace();
          });
}

StoredRow<Eigen::VectorXd> stored_state(int dof) {
  StoredRow<Eigen::VectorXd> state;
  for (int j = 0; j < dof; ++j) {
    state.add(
        "q." + std::to_string(j), [j](const Eigen::VectorXd& q) { return q[j]; },
        [j, dof](Eigen::VectorXd& q, double value) {
          q.conservativeResize(dof);
          q[j] = value;
        });
  }
  return state;
}

StoredRow<SceneRow> stored_scene() {
  return StoredRow<SceneRow>()
      .add("scene", &SceneRow::scene)
      .add("mean_side_m", &SceneRow::mean_side_m)
      .add(
          "unsigned.field_ms", [](auto& row) -> auto& { return row.field_ms[kUnsigned]; })
      .add(
          "signed.field_ms", [](auto& row) -> auto& { return row.field_ms[kSigned]; });
}

const StoredRow<ProblemOutcome>& stored_problem() {
  static const auto kProblem = [] {
    using Field = FieldOutcome;
    StoredRow<ProblemOutcome> stored;
    stored.add("problem", &ProblemOutcome::problem)
        .add("start_free", &ProblemOutcome::start_free)
        .add("goal_free", &ProblemOutcome::goal_free);
    for (const std::size_t kind : {kUnsigned, kSigned}) {
      const auto add = [&](const char* key, auto member) {
        stored.add(
            std::string(kFieldNames[kind]) + "." + key,
            [ kind, member ](auto& row) -> auto& { return row.fields[kind].*member; });
      };
      stored.add(
          std::string(kFieldNames[kind]) + ".status",
          [kind](const ProblemOutcome& row) {
            const Field& field = row.fields[kind];
            return field.attempted ? static_cast<double>(field.status) : kSkipped;
          },
          [kind](ProblemOutcome& row, double status) {
            row.fields[kind].attempted = status != kSkipped;
            if (status != kSkipped) {
              row.fields[kind].status = static_cast<SolveStatus>(static_cast<int>(status));
            }
          });
      add("collision_free", &Field::collision_free);
      add("iterations", &Field::iterations);
      add("steps", &Field::steps);
      add("cost", &Field::cost);
      add("clearance_m", &Field::clearance_m);
      add("solve_ms", &Field::solve_ms);
      add("check_ms", &Field::check_ms);
    }
    return stored;
  }();
  return kProblem;
}

Result<StudyRobotRows> read_robot(ResultsReader& reader, std::size_t robot,
                                  const std::string& file) {
  const auto item = static_cast<std::int64_t>(robot);
  auto rows = SIDESTEP_TRY(stored_robot().read(reader, "robot", item, file));
  if (rows.published) {
    auto plain = SIDESTEP_TRY(stored_published("unsigned").read(reader, "robot", item, file));
    auto with_sign = SIDESTEP_TRY(stored_published("signed").read(reader, "robot", item, file));
    rows.published = PublishedComparison{plain, with_sign};
  }
  const auto read_series = [&](auto& into, const auto& stored, const char* series) -> Result<void> {
    auto read = SIDESTEP_TRY(stored.read_all(reader, of_robot(series, robot), file));
    for (auto& numbered : read) into.push_back(std::move(numbered.second));
    return {};
  };
  SIDESTEP_TRY(read_series(rows.drawn_states, stored_state(rows.dof), "state"));
  SIDESTEP_TRY(read_series(rows.drawn, stored_scene(), "scene"));
  SIDESTEP_TRY(read_series(rows.problems, stored_problem(), "problem"));
  return rows;
}

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

Json mean_json(const MeanWithInterval& mean) {
  if (mean.count == 0) {
    return {{"count", 0},    {"mean", nullptr}, {"sd", nullptr},
            {"ci", nullptr}, {"p50", nullptr},  {"p95", nullptr}};
  }
  return {{"count", mean.count},        {"mean", mean.statistics.mean},
          {"sd", mean.statistics.sd},   {"ci", interval_json(mean.interval)},
          {"p50", mean.statistics.p50}, {"p95", mean.statistics.p95}};
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
  const double share = static_cast<double>(failures) / static_cast<double>(solvable);
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
  const auto times = [&](auto member) -> Json {
    const Statistics all = statistics_of(
        values_of(attempted, [=](const P& problem) { return problem.fields[kind].*member; }));
    return {{"mean", all.mean}, {"p50", all.p50}, {"p95", all.p95}, {"max", all.max}};
  };
  return {{"attempted", attempted.size()},
          {"collision_free", with(&F::collision_free, true)},
          {"failures", failures},
          {"failure_percent", solvable > 0 ? Json(100.0 * share) : Json(nullptr)},
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

Json study_time_json(const StudyRecord& study) {
  double solve_s = 0.0, check_s = 0.0, field_s = 0.0;
  for (const StudyRobotRows& robot : study.robots) {
    for (const ProblemOutcome& problem : robot.problems) {
      solve_s += 1e-3 * (problem.fields[kUnsigned].solve_ms + problem.fields[kSigned].solve_ms);
      check_s += 1e-3 * (problem.fields[kUnsigned].check_ms + problem.fields[kSigned].check_ms);
    }
    for (const SceneRow& scene : robot.drawn) {
      field_s += 1e-3 * (scene.field_ms[kUnsigned] + scene.field_ms[kSigned]);
    }
  }
  Json time = time_json(study);
  time.update({{"solve_s", solve_s}, {"check_s", check_s}, {"field_s", field_s}});
  return time;
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

}  // namespace

void record_study(const StudyRecord& study, Recorder& recorder) {
  record_run_head(study, "study", recorder);
  stored_study().record(study, "study", 0, recorder);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    const StudyRobotRows& robot = study.robots[r];
    const auto item = static_cast<std::int64_t>(r);
    stored_robot().record(robot, "robot", item, recorder);
    stored_state(robot.dof).record_all(robot.drawn_states, of_robot("state", r), recorder);
    if (!robot.published) continue;
    stored_published("unsigned").record(robot.published->unsigned_field, "robot", item, recorder);
    stored_published("signed").record(robot.published->signed_field, "robot", item, recorder);
  }
}

void record_scene(const SceneRow& scene, std::size_t robot, Recorder& recorder) {
  stored_scene().record(scene, of_robot("scene", robot), scene.scene, recorder);
}

void record_problem(const ProblemOutcome& problem, std::size_t robot, Recorder& recorder) {
  stored_problem().record(problem, of_robot("problem", robot), problem.problem, recorder);
}

Result<StudyRecord> read_study(const std::filesystem::path& path) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(path));
  const std::string file = path.string();
  auto head = SIDESTEP_TRY(read_run_head(*reader, "study", file));
  auto study = SIDESTEP_TRY(stored_study().read(*reader, "study", 0, file));
  static_cast<DividedRun&>(study) = std::move(head);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    study.robots[r] = SIDESTEP_TRY(read_robot(*reader, r, file));
  }
  return study;
}

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
  const Json particulars = {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
                            {"complete", complete},
                            {"shard", shard_json(study.shard)},
                            {"confidence", study.confidence},
                            {"published_as", study.published_as},
                            {"robots", robots},
                            {"time", study_time_json(study)}};
  show_study(particulars, outcome);
  outcome.summary_json = summary_text(study.provenance, "field_study", outcome, particulars);
  return outcome;
}

}  // namespace sidestep
