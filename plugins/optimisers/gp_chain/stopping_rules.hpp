#pragma once

namespace sidestep {

/// GPMP2's stopping rules, which look at accepted steps.
struct StoppingRules {
  double relative_tolerance = 1e-5;
  double absolute_tolerance = 1e-5;
  int max_iterations = 100;
};

/// How a minimisation ended.
struct Minimisation {
  enum class End { kConverged, kIterationLimit, kDeadline, kSingular };
  End end = End::kConverged;
  int accepted = 0;            ///< Iterations as GPMP2 counts them.
  int tried = 0;               ///< All steps, rejected ones included.
  double last_decrease = 0.0;  ///< Of the cost, by the last accepted step.
};

}  // namespace sidestep
