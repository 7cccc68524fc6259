#pragma once

#include <optional>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/retime.hpp>

namespace sidestep {

/// What makes a motion of an optimiser's proposal.
struct MotionRules {
  const MotionLimits* limits = nullptr;  ///< That it is timed by; null: as the optimiser timed it.
  const ValidityCheck* check = nullptr;  ///< That it must pass; null: none.
  RetimeSettings timing = {};
};

/// What came of one first guess.
struct PlannedMotion {
  Solution solution;      ///< The optimiser's; solve_ms is the wall time of the call.
  Trajectory trajectory;  ///< Timed; empty where there is none.
  std::optional<double> deviation = {};  ///< Retiming::deviation; nothing where it was not timed.
  double retime_ms = 0.0;
  std::optional<Verdict> verdict = {};  ///< Of the check.
  std::string failure = {};             ///< Why not to follow it; empty where all is well.
};

/// Solves from a first guess, times the path anew, and checks that the motion leads from the
/// problem's start to its goal and is valid: the planning twin of MappingPipeline. A proposal that
/// will not do is a PlannedMotion with a failure. Fails where the optimiser or the check does,
/// naming it; what they throw becomes an error. [planning]; allocates.
[[nodiscard]] Result<PlannedMotion> plan_motion(const PluginPtr<Optimiser>& optimiser,
                                                const Problem& problem, const Trajectory& guess,
                                                const MotionRules& rules, const Deadline& deadline);

/// How a trajectory fails to lead from the problem's start to its goal; empty where it does.
[[nodiscard]] std::string endpoint_miss(const Problem& problem, const Trajectory& trajectory);

}  // namespace sidestep
