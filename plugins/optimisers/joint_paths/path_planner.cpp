#include "path_planner.hpp"

#include <optional>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/goal.hpp>

namespace sidestep::joint_paths {
namespace {

std::string why_blocked(const char* which, const Violation& violation) {
  const bool is_limit = violation.kind == Violation::Kind::kPositionLimit;
  return std::string(which) +
         (is_limit                                            ? " breaks a joint limit: "
          : violation.kind == Violation::Kind::kSelfCollision ? " is in self-collision: "
                                                              : " is in collision: ") +
         violation.what();
}

std::string why_not_free(const Problem& problem) {
  return "the goal configuration is left to costs (" + goal_cost_names(problem) +
         "), and sampling planners know of none: give a goal configuration alone, or use an "
         "optimiser that minimises costs, such as gp_chain";
}

/// Why there is nothing to search for, if so.
std::optional<std::string> objection(const Problem& problem, Checker& checker) {
  if (is_goal_free(problem)) return why_not_free(problem);
  for (const RobotState* state : {&problem.start, &problem.goal}) {
    const std::span<const double> q = as_span(state->q);
    if (checker.is_clear(q)) continue;
    const auto violation = checker.violation(q);
    if (violation) return why_blocked(state == &problem.start ? "start" : "goal", *violation);
  }
  return std::nullopt;
}

}  // namespace

Result<Solution> PathPlanner::solve(const Problem& problem, const Trajectory&,
                                    const Deadline& deadline) {
  const Stopwatch stopwatch;
  SIDESTEP_TRY(problem.validate());
  if (!problem.field) {
    return fail(ErrorCode::kInvalidArgument, "a sampling planner needs a distance field");
  }
  SIDESTEP_TRY(check(problem));
  SIDESTEP_TRY(checker_->look_at(problem));
  Solution solution;
  if (auto reason = objection(problem, *checker_)) {
    solution = no_path(*std::move(reason));
  } else {
    if (!problem.start.qdot.isZero(1e-9) || !problem.goal.qdot.isZero(1e-9)) {
      log_.warn(
          "paths are planned from rest to rest; the velocities of start and goal are ignored");
    }
    solution = SIDESTEP_TRY(search(problem, *checker_, deadline));
  }
  solution.solve_ms = stopwatch.elapsed_ms();
  return solution;
}

Solution timed(const Problem& problem, std::span<const double> path) {
  Solution solution;
  auto trajectory = time_path(problem.robot->description(), path, problem.speed_fraction);
  if (!trajectory) {
    solution.reason = trajectory.error().describe();
    return solution;
  }
  solution.status = SolveStatus::kConverged;
  solution.trajectory = std::move(*trajectory);
  return solution;
}

Solution no_path(std::string reason) {
  Solution solution;
  solution.status = SolveStatus::kNoPath;
  solution.reason = std::move(reason);
  return solution;
}

}  // namespace sidestep::joint_paths
