#pragma once

#include <sidestep/core/time.hpp>

#include "chain_model.hpp"
#include "step_rules.hpp"

namespace sidestep {

/// GPMP2's stopping rules, which look at accepted steps.
struct StoppingRules {
  double relative_tolerance = 1e-5;
  double absolute_tolerance = 1e-5;
  int max_iterations = 100;
};

struct Minimisation {
  enum class End { kConverged, kIterationLimit, kDeadline, kSingular };
  End end = End::kConverged;
  int accepted = 0;            ///< Iterations as GPMP2 counts them.
  int tried = 0;               ///< All steps, rejected ones included.
  double last_decrease = 0.0;  ///< Of the cost, by the last accepted step.
};

/// Improves the model's current trajectory until an accepted step lowers the cost by no more than
/// a tolerance allows, no step lowers it, or a limit is met; the deadline within one step. The
/// best trajectory is the model's current one. [planning]; does not allocate.
[[nodiscard]] Minimisation minimise(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                                    const Deadline& deadline);

}  // namespace sidestep
