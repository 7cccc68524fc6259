#include <sidestep/runtime/motion_planning.hpp>

#include <utility>

#include <sidestep/planning/goal.hpp>
#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

/// What no optimiser may return; empty if all is well.
std::string why_broken(const Trajectory& trajectory, const RobotDescription& robot) {
  if (auto sound = trajectory.validate(); !sound) return sound.error().describe();
  if (trajectory.dof != robot.dof()) {
    return "it moves " + std::to_string(trajectory.dof) + " joints, the robot has " +
           std::to_string(robot.dof());
  }
  return trajectory.size() < 2 ? "it has one state only" : "";
}

}  // namespace

std::string endpoint_miss(const Problem& problem, const Trajectory& trajectory) {
  const std::string off =
      configuration_miss(problem.robot->description(), trajectory.q(0), problem.start.q);
  if (!off.empty()) return "the trajectory starts with " + off;
  const std::string miss = goal_miss(problem, trajectory.q(trajectory.size() - 1));
  return miss.empty() ? "" : "the trajectory ends with " + miss;
}

Result<Proposal> propose_motion(Optimiser& optimiser, const std::string& name,
                                const Problem& problem, const Trajectory& guess,
                                const Deadline& deadline) {
  const Stopwatch watch;
  auto solution =
      SIDESTEP_TRY(call_stage(name, [&] { return optimiser.solve(problem, guess, deadline); }));
  Proposal proposal{std::move(solution), {}, false};
  proposal.solution.solve_ms = watch.elapsed_ms();  // ours, not the plugin's word for it
  const Solution& its = proposal.solution;
  const bool may_be_empty = its.status == SolveStatus::kNoPath ||
                            its.status == SolveStatus::kFailed ||
                            its.status == SolveStatus::kDeadline;
  if (its.trajectory.size() == 0 && may_be_empty) {
    proposal.failure = "found no trajectory (" + std::string(to_string(its.status)) +
                       (its.reason.empty() ? ")" : ": " + its.reason + ")");
    return proposal;
  }
  const std::string broken = why_broken(its.trajectory, problem.robot->description());
  if (broken.empty()) return proposal;
  proposal.failure = "returned a broken trajectory: " + broken;
  proposal.is_fault = true;
  proposal.solution.trajectory = {};
  return proposal;
}

Result<PlannedMotion> retime_and_check(const Problem& problem, const Trajectory& path,
                                       const MotionRequirements& rules, const Deadline& deadline) {
  PlannedMotion planned{.trajectory = path};
  if (rules.limits != nullptr) {
    const Stopwatch timing;
    auto retimed = retime(path, *rules.limits, rules.timing);
    planned.retime_ms = timing.elapsed_ms();
    if (!retimed) {
      planned.trajectory = {};
      planned.failure = "the path cannot be retimed: " + retimed.error().describe();
      return planned;
    }
    planned.trajectory = std::move(retimed->trajectory);
    planned.deviation = retimed->deviation;
  }
  planned.failure = endpoint_miss(problem, planned.trajectory);
  if (rules.check == nullptr) return planned;
  auto verdict = SIDESTEP_TRY(rules.check->check(planned.trajectory, 0.0, deadline));
  if (!verdict.valid() && planned.failure.empty()) {
    planned.failure = "the trajectory is " + verdict.describe();
  }
  planned.verdict = std::move(verdict);
  return planned;
}

Result<PlannedMotion> plan_motion(const PluginPtr<Optimiser>& optimiser, const Problem& problem,
                                  const Trajectory& guess, const MotionRequirements& rules,
                                  const Deadline& deadline) {
  auto proposal =
      SIDESTEP_TRY(propose_motion(*optimiser, plugin_of(optimiser), problem, guess, deadline));
  if (!proposal.failure.empty()) {
    return PlannedMotion{.solution = std::move(proposal.solution),
                         .failure = "the optimiser " + proposal.failure};
  }
  auto planned = retime_and_check(problem, proposal.solution.trajectory, rules, deadline);
  if (planned) planned->solution = std::move(proposal.solution);
  return planned;
}

}  // namespace sidestep
