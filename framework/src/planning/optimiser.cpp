#include <sidestep/planning/optimiser.hpp>

#include <sidestep/core/format.hpp>

namespace sidestep {

std::string_view to_string(SolveStatus status) noexcept {
  switch (status) {
    case SolveStatus::kConverged: return "converged";
    case SolveStatus::kIterationLimit: return "iteration_limit";
    case SolveStatus::kDeadline: return "deadline";
    case SolveStatus::kNoPath: return "no_path";
    case SolveStatus::kFailed: return "failed";
  }
  return "failed";
}

Result<void> check_initial(const Problem& problem, const Trajectory& initial) {
  SIDESTEP_TRY(initial.validate());
  const int dof = problem.robot->description().dof();
  if (initial.dof == dof && initial.size() == problem.support_states) return {};
  return invalid("the initial trajectory has " + std::to_string(initial.size()) + " states of " +
                 std::to_string(initial.dof) + " joints, but the problem " +
                 std::to_string(problem.support_states) + " of " + std::to_string(dof));
}

std::string iteration_limit_reason(int iterations, double last_decrease, double cost) {
  return "stopped after " + std::to_string(iterations) +
         " iterations, when the last accepted one still lowered the cost by " +
         format("%.2g %%", 100.0 * last_decrease / (cost + last_decrease));
}

}  // namespace sidestep
