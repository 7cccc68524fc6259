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

/// Requirements for a motion: its limits, its check and how a path is timed.
struct MotionRequirements {
  const MotionLimits* limits = nullptr;  ///< That it is timed by; null: as the optimiser timed it.
  const ValidityCheck* check = nullptr;  ///< That it must pass; null: none.
  RetimeSettings timing = {};
};

/// An optimiser's result from one first guess.
struct Proposal {
  Solution solution;  ///< Without a trajectory where that cannot be used; solve_ms is wall time.
  /// Why there is no trajectory to use, to follow the optimiser's name: "found no trajectory
  /// (...)". Empty where there is one.
  std::string failure;
  bool is_fault = false;  ///< The optimiser returned what none may: no failure of the task.
};

/// Solves from a first guess; `name` is the plugin's. Fails where the optimiser does, naming it;
/// what it throws becomes an error. [planning]; allocates.
[[nodiscard]] Result<Proposal> propose_motion(Optimiser& optimiser, const std::string& name,
                                              const Problem& problem, const Trajectory& guess,
                                              const Deadline& deadline);

/// The planned motion from one first guess.
struct PlannedMotion {
  Solution solution;      ///< The optimiser's; solve_ms is the wall time of the call.
  Trajectory trajectory;  ///< Timed; empty where there is none.
  std::optional<double> deviation = {};  ///< Retiming::deviation; nothing where it was not timed.
  double retime_ms = 0.0;
  std::optional<Verdict> verdict = {};  ///< Of the check.
  std::string failure = {};             ///< Why not to follow it; empty where all is well.
};

/// Retimes a path and checks that the motion leads from the problem's start to its goal; with a
/// check, that it is valid, too. Fails where the check does. [planning]; allocates.
[[nodiscard]] Result<PlannedMotion> retime_and_check(const Problem& problem, const Trajectory& path,
                                                     const MotionRequirements& rules,
                                                     const Deadline& deadline);

/// propose_motion(), then retime_and_check(): the planning twin of MappingPipeline. A proposal that
/// will not do is a PlannedMotion with a failure. Fails as they do. [planning]; allocates.
[[nodiscard]] Result<PlannedMotion> plan_motion(const PluginPtr<Optimiser>& optimiser,
                                                const Problem& problem, const Trajectory& guess,
                                                const MotionRequirements& rules,
                                                const Deadline& deadline);

/// How a trajectory fails to lead from the problem's start to its goal; empty where it does.
[[nodiscard]] std::string endpoint_miss(const Problem& problem, const Trajectory& trajectory);

}  // namespace sidestep
