#include "study_solve.hpp"

#include <sidestep/core/index.hpp>
#include <sidestep/runtime/guarded.hpp>

namespace sidestep {
namespace {

Error cancelled() {
  return Error{ErrorCode::kCancelled, "the study was interrupted", {}, {}, nullptr};
}

}  // namespace

std::pair<int, int> states_of_pair(std::int64_t pair, int states) {
  int first = 0;
  for (std::int64_t left = states - 1; pair >= left; --left, ++first) pair -= left;
  return {first, first + 1 + static_cast<int>(pair)};
}

StudySolver::StudySolver(const StudyRobot& study, std::shared_ptr<const RobotModel> robot,
                         std::span<const Eigen::VectorXd> states, PluginPtr<Optimiser> optimiser,
                         bool skips_collisions)
    : study_(study),
      robot_(std::move(robot)),
      states_(states),
      optimiser_(std::move(optimiser)),
      skips_collisions_(skips_collisions) {}

Result<ProblemOutcome> StudySolver::solve(const StudyScene& scene, std::int64_t pair,
                                          const Deadline& deadline) {
  const auto count = static_cast<std::int64_t>(states_.size());
  const auto [start, goal] = states_of_pair(pair, static_cast<int>(count));
  ProblemOutcome outcome;
  outcome.problem = scene.scene * (count * (count - 1) / 2) + pair;
  outcome.start_free = scene.state_free[idx(start)] != 0;
  outcome.goal_free = scene.state_free[idx(goal)] != 0;
  if (skips_collisions_ && !(outcome.start_free && outcome.goal_free)) return outcome;
  for (const std::size_t kind : {kUnsigned, kSigned}) {
    outcome.fields[kind] = SIDESTEP_TRY(solve_in(scene, kind, start, goal, deadline));
  }
  return outcome;
}

Result<FieldOutcome> StudySolver::solve_in(const StudyScene& scene, std::size_t kind, int start,
                                           int goal, const Deadline& deadline) {
  Problem problem = make_problem(robot_, scene.fields[kind], study_.planning, states_[idx(start)],
                                 states_[idx(goal)]);
  if (study_.entry.support_states) problem.support_states = *study_.entry.support_states;
  if (study_.entry.duration_s) {
    problem.dt_s = *study_.entry.duration_s / (problem.support_states - 1);
  }
  const Trajectory line =
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  auto solution = SIDESTEP_TRY(
      in_stage(plugin_of(optimiser_), [&] { return optimiser_->solve(problem, line, deadline); }));
  if (deadline.expired()) return tl::make_unexpected(cancelled());
  FieldOutcome outcome;
  outcome.attempted = true;
  outcome.status = solution.status;
  outcome.iterations = solution.accepted_iterations;
  outcome.steps = solution.iterations;
  outcome.cost = solution.cost;
  outcome.solve_ms = solution.solve_ms;
  if (solution.trajectory.size() == 0) return outcome;
  const Stopwatch watch;
  const auto verdict = scene.check->check(solution.trajectory, 0.0, deadline);
  outcome.check_ms = watch.elapsed_ms();
  if (!verdict && deadline.expired()) return tl::make_unexpected(cancelled());
  if (!verdict) return error_of(verdict);
  outcome.collision_free = verdict->valid();
  outcome.clearance_m = verdict->min_clearance_m;
  return outcome;
}

}  // namespace sidestep
