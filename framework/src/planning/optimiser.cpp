#include <sidestep/planning/optimiser.hpp>

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

}  // namespace sidestep
