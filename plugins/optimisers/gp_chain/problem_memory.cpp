#include "problem_memory.hpp"

#include <algorithm>

namespace sidestep {

void ProblemMemory::remember(const Problem& problem) {
  robot_ = problem.robot;
  support_states_ = problem.support_states;
  interpolated_checks_ = problem.interpolated_checks;
  dt_s_ = problem.dt_s;
  qc_ = problem.qc;
  terms_ = problem.terms;
}

ProblemChange ProblemMemory::change_to(const Problem& problem) const {
  ProblemChange change;
  change.chain =
      robot_ != problem.robot || support_states_ != problem.support_states ||
      interpolated_checks_ != problem.interpolated_checks || dt_s_ != problem.dt_s ||
      qc_.size() != problem.qc.size() || qc_ != problem.qc ||
      !std::ranges::equal(terms_, problem.terms, {}, &CostTerm::placement, &CostTerm::placement);
  if (change.chain) return change;
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    if (terms_[t].cost == problem.terms[t].cost) continue;
    switch (terms_[t].placement) {
      case Placement::kStart: change.start = true; break;
      case Placement::kGoal: change.goal = true; break;
      case Placement::kSupport:
      case Placement::kSupportAndInterpolated: change.along = true; break;
    }
  }
  return change;
}

}  // namespace sidestep
