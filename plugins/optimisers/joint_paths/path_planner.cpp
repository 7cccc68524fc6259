#include "path_planner.hpp"

#include <optional>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/inverse_kinematics.hpp>

#include "steering.hpp"

namespace sidestep::joint_paths {
namespace {

/// E.g. "is in collision: ..."; empty where the checker has nothing to say.
std::string why_blocked(Checker& checker, std::span<const double> q) {
  if (checker.is_clear(q)) return "";
  const auto violation = checker.violation(q);
  if (!violation) return "";
  const bool is_limit = violation->kind == Violation::Kind::kPositionLimit;
  return std::string(is_limit                                             ? "breaks a joint limit: "
                     : violation->kind == Violation::Kind::kSelfCollision ? "is in self-collision: "
                                                                          : "is in collision: ") +
         violation->what();
}

/// Where the robot may end; a reason why nowhere.
GoalConfigurations goals_of(const Problem& problem, std::size_t wanted, std::uint64_t seed,
                            Checker& checker, const Deadline& deadline) {
  const auto blocked = [&](std::span<const double> q) { return why_blocked(checker, q); };
  if (is_goal_free(problem)) {
    return find_goals(problem, {.wanted = wanted}, seed, blocked, deadline);
  }
  std::string why = blocked(as_span(problem.goal.q));
  if (!why.empty()) return {.q = {}, .reason = "goal " + why};
  return {.q = {problem.goal.q}, .reason = {}};
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
  GoalConfigurations goals;
  const std::string start_blocked = why_blocked(*checker_, as_span(problem.start.q));
  if (start_blocked.empty()) {
    goals =
        goals_of(problem, goal_configurations_, seed_, *checker_, deadline.capped_s(max_time_s_));
  } else {
    goals.reason = "start " + start_blocked;
  }
  if (goals.q.empty()) {
    solution = no_path(std::move(goals.reason));
    if (deadline.expired()) solution.status = SolveStatus::kDeadline;
  } else {
    if (!problem.start.qdot.isZero(1e-9) || !problem.goal.qdot.isZero(1e-9)) {
      log_.warn(
          "paths are planned from rest to rest; the velocities of start and goal are ignored");
    }
    Problem task = problem;
    task.goal.q = goals.q.front();
    solution = SIDESTEP_TRY(search(task, goals.q, *checker_, deadline));
  }
  solution.solve_ms = stopwatch.elapsed_ms();
  return solution;
}

Solution timed(const Problem& problem, std::span<const double> path, Checker& checker,
               double resolution_m, const Deadline& deadline) {
  Solution solution;
  const RobotDescription& robot = problem.robot->description();
  auto trajectory = robot.rolling ? drive(problem, path, checker, resolution_m, deadline)
                                  : time_path(robot, path, problem.speed_fraction);
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
