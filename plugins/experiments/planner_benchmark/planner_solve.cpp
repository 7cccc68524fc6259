#include <cmath>

#include <sidestep/certificates/leave_certificate.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include "planner_rows.hpp"

namespace sidestep {
namespace {

/// Clearance that smooth motions keep beyond what is asked for, so that the independent check can
/// show them clear, too: its steps near obstacles are up to 0.5 mm long and its distances err by
/// 1e-5 m. Sampling planners keep such a distance themselves.
constexpr double kSpareMargin_m = 3e-4;

/// The independent check: the robot's shapes against the true scene.
Result<std::unique_ptr<ValidityCheck>> true_check(const SetProblem& posed, const SetBench& bench) {
  ShapeObstacles truth;
  truth.scene = posed.scene;
  return make_shape_check(bench.robot, truth, bench.check.of_shapes());
}

struct OwnChecks {
  std::shared_ptr<const ValidityCheck> sampled;
  std::shared_ptr<const ValidityCheck> smooth;
};

/// What proposals are checked by in the race.
Result<OwnChecks> checks_of(const SetProblem& posed,
                            const std::shared_ptr<const DistanceField>& field,
                            const SetBench& bench, bool by_shapes) {
  if (by_shapes) {
    const std::shared_ptr<const ValidityCheck> shared = SIDESTEP_TRY(true_check(posed, bench));
    return OwnChecks{shared, shared};
  }
  FieldCheckSettings settings = bench.check.of_field();
  settings.first_violation_only = true;
  const FieldChecks checks(bench.robot);
  OwnChecks own;
  own.sampled = checks.make(field, bench.planning.space(), settings);
  settings.margin_m += kSpareMargin_m;
  own.smooth = checks.make(field, bench.planning.space(), settings);
  return own;
}

/// Where a trajectory does not begin or end as it should; empty where it does.
std::string miss_of(const Trajectory& trajectory, const SetProblem& posed,
                    const RobotDescription& robot) {
  for (std::size_t j = 0; j < trajectory.q(0).size(); ++j) {
    const double off = trajectory.q(0)[j] - posed.q_start[static_cast<Eigen::Index>(j)];
    if (!(std::abs(off) <= kGoalTolerance)) return "it starts where the robot is not";
  }
  const std::string by =
      configuration_miss(robot, trajectory.q(trajectory.size() - 1), posed.q_goal);
  return by.empty() ? "" : "it ends with " + by;
}

/// Holds answers against the true shapes; the last one is what the solve is about.
Result<void> judge(const SetProblem& posed, const RaceResult& answer, const SetBench& bench,
                   SetSolve& solve) {
  const auto check = SIDESTEP_TRY(true_check(posed, bench));
  const auto hear = [&](const Trajectory& trajectory, bool is_smooth,
                        double time_ms) -> Result<void> {
    solve.answers.push_back(
        {static_cast<float>(time_ms), static_cast<float>(path_length(trajectory)), is_smooth});
    solve.duration_s = trajectory.duration_s();
    solve.acceleration_ratio = acceleration_ratio(trajectory);
    const auto verdict = SIDESTEP_TRY(check->check(trajectory, 0.0, Deadline(bench.stop)));
    solve.clearance_m = verdict.min_clearance_m;
    if (!solve.refusal.empty()) return {};
    solve.refusal = miss_of(trajectory, posed, bench.robot->description());
    if (solve.refusal.empty() && !verdict.valid()) solve.refusal = verdict.describe();
    return {};
  };
  for (const EarlierAnswer& earlier : answer.earlier) {
    SIDESTEP_TRY(hear(earlier.trajectory, earlier.is_smooth, earlier.took_ms));
  }
  return hear(answer.trajectory, answer.is_smooth, answer.took_ms);
}

}  // namespace

double path_length(const Trajectory& trajectory) {
  double length = 0.0;
  for (int i = 1; i < trajectory.size(); ++i) {
    double squares = 0.0;
    for (std::size_t j = 0; j < trajectory.q(i).size(); ++j) {
      const double step = trajectory.q(i)[j] - trajectory.q(i - 1)[j];
      squares += step * step;
    }
    length += std::sqrt(squares);
  }
  return length;
}

double acceleration_ratio(const Trajectory& trajectory) {
  constexpr int kSteps = 1000;
  const double length = path_length(trajectory);
  if (!(length > 0.0)) return 0.0;
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  const double duration_s = trajectory.duration_s();
  const double step_s = duration_s / kSteps;
  std::vector<double> q(dof), before(dof), now(dof);
  trajectory.sample(0.0, q, before);
  double integral = 0.0;
  for (int step = 1; step <= kSteps; ++step) {
    trajectory.sample(step_s * step, q, now);
    for (std::size_t j = 0; j < dof; ++j) {
      integral += (now[j] - before[j]) * (now[j] - before[j]) / step_s;
    }
    before.swap(now);
  }
  return integral * duration_s * duration_s * duration_s / (12.0 * length * length);
}

Result<SetSolve> solve_set_problem(PlanningRace& race, const SetProblem& posed, std::uint64_t seed,
                                   const SetBench& bench, bool by_shapes) {
  SetSolve solve;
  solve.family = posed.family;
  solve.index = posed.index;
  const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(bench.reach_m);
  const auto field = std::make_shared<const SceneField>(*posed.scene, Stamp(),
                                                        Eigen::AlignedBox3d(-reach_m, reach_m));
  const Problem problem =
      make_problem(bench.robot, field, bench.planning, posed.q_start, posed.q_goal);
  if (auto sound = problem.validate(); !sound) {
    solve.reason = "the problem makes no sense: " + sound.error().describe();
    return solve;
  }
  const auto checks = SIDESTEP_TRY(checks_of(posed, field, bench, by_shapes));
  const Stopwatch watch;
  auto answer =
      SIDESTEP_TRY(race.run(problem, {*checks.sampled, *checks.smooth},
                            derive_seed(seed, posed.family + "/" + std::to_string(posed.index)),
                            Deadline::after_s(bench.deadline_s, bench.stop), bench.stop));
  solve.spent_ms = watch.elapsed_ms();
  solve.reason = answer.reason;
  solve.guess = answer.seed;
  if (answer.trajectory.size() == 0) return solve;
  SIDESTEP_TRY(judge(posed, answer, bench, solve));
  if (!bench.certificates.empty() && solve.is_solved()) {
    ShapeObstacles truth;
    truth.scene = posed.scene;
    const std::string name = posed.family + "-" + std::to_string(posed.index) + ".json";
    solve.certified = name_of(SIDESTEP_TRY(
        leave_certificate(*bench.robot, truth, {}, answer.trajectory, bench.certificates / name)));
  }
  return solve;
}

}  // namespace sidestep
