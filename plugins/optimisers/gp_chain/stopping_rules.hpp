#pragma once

namespace sidestep {

/// GPMP2's stopping rules, which look at accepted steps.
struct StoppingRules {
  double relative_tolerance = 1e-5;  ///< Also ends Levenberg-Marquardt's retries.
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

/// How Levenberg-Marquardt's lambda changes: divided by this after an accepted step, times this
/// after a refused one,
inline constexpr double kDampingFactor = 10.0;
/// up to here, where no step is worth trying any more,
inline constexpr double kLargestDamping = 1e5;
/// and down to this share of the initial one.
inline constexpr double kLeastDampingShare = 1e-4;
/// A step whose length is more than this share of the one just refused is not tried.
inline constexpr double kSameLength = 0.99999;
/// What of the decrease that the normal equations promise a step must achieve to be accepted.
inline constexpr double kLeastFidelity = 1e-3;

}  // namespace sidestep
