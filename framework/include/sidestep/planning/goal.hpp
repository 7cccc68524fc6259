#pragma once

#include <span>
#include <string>

#include <sidestep/planning/problem.hpp>

namespace sidestep {

inline constexpr double kGoalTolerance = 1e-3;  ///< Of each joint at a goal configuration: m, rad.
inline constexpr double kGoalToleranceSigmas = 3.0;  ///< Of what a cost at kGoal measures.

/// The first joint farther than kGoalTolerance from its target, e.g. "joint 'lift' 0.05 m off";
/// empty if there is none. [any]; allocates.
[[nodiscard]] std::string configuration_miss(const RobotDescription& robot,
                                             std::span<const double> q,
                                             const Eigen::VectorXd& wanted);

/// True of a cost at kGoal that measures where the robot ends, not how fast.
[[nodiscard]] bool decides_goal(const CostTerm& term) noexcept;

/// True if terms at kGoal, none of which is the goal prior of standard_terms(), say where the robot
/// ends: problem.goal is then only where guesses head for. [any]
[[nodiscard]] bool is_goal_free(const Problem& problem) noexcept;

/// Names of the costs at kGoal, quoted: "'position_hand', 'level'". [any]; allocates.
[[nodiscard]] std::string goal_cost_names(const Problem& problem);

/// How a configuration (dof values), at rest, misses the goal, e.g. "the position of hand 0.05 m
/// off its target"; empty if it does not. A goal configuration is missed if any joint is more than
/// kGoalTolerance off; a free one if anything that a cost at kGoal measures, of those that do not
/// depend on velocity, is more than kGoalToleranceSigmas standard deviations off. What it measures,
/// the cost may say (residual_names.hpp); else it is each of its residuals. [any]; allocates.
[[nodiscard]] std::string goal_miss(const Problem& problem, std::span<const double> q);

}  // namespace sidestep
