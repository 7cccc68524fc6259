#include <sidestep/runtime/motion_planning.hpp>

#include <utility>

#include <sidestep/planning/goal.hpp>
#include <sidestep/runtime/guarded.hpp>

namespace sidestep {

std::string endpoint_miss(const Problem& problem, const Trajectory& trajectory) {
  const std::string off =
      configuration_miss(problem.robot->description(), trajectory.q(0), problem.start.q);
  if (!off.empty()) return "the trajectory starts with " + off;
  const std::string miss = goal_miss(problem, trajectory.q(trajectory.size() - 1));
  return miss.empty() ? "" : "the trajectory ends with " + miss;
}

Result<PlannedMotion> plan_motion(const PluginPtr<Optimiser>& optimiser, const Problem& problem,
                                  const Trajectory& guess, const MotionRules& rules,
                                  const Deadline& deadline) {
  PlannedMotion planned;
  const Stopwatch watch;
  auto solution =
      in_stage(plugin_of(optimiser), [&] { return optimiser->solve(problem, guess, deadline); });
  if (!solution) return error_of(solution);
  planned.solution = std::move(*solution);
  planned.solution.solve_ms = watch.elapsed_ms();  // ours, not the plugin's word for it
  const Trajectory& proposal = planned.solution.trajectory;
  if (proposal.size() == 0) {
    planned.failure =
        "the optimiser found no trajectory (" + std::string(to_string(planned.solution.status)) +
        (planned.solution.reason.empty() ? ")" : ": " + planned.solution.reason + ")");
    return planned;
  }
  if (auto sound = proposal.validate(); !sound) {
    planned.failure = "the optimiser returned a broken trajectory: " + sound.error().describe();
    planned.solution.trajectory = {};
    return planned;
  }
  planned.trajectory = proposal;
  if (rules.limits != nullptr) {
    const Stopwatch timing;
    auto retimed = retime(proposal, *rules.limits, rules.timing);
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
  auto verdict = rules.check->check(planned.trajectory, 0.0, deadline);
  if (!verdict) return error_of(verdict);
  if (!verdict->valid() && planned.failure.empty()) planned.failure = verdict->describe();
  planned.verdict = std::move(*verdict);
  return planned;
}

}  // namespace sidestep
