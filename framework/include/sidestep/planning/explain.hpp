#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// One active cost or violation over one stretch of a trajectory.
struct Hindrance {
  enum class Kind {
    kCollision,      ///< A link near or in an obstacle, the floor, or space that counts as one.
    kSelfCollision,  ///< Two links near or in each other.
    kLimit,          ///< A joint near or beyond a limit.
    kEndpoint,       ///< A joint off the start or the goal, a link off its goal.
    kOther           ///< The GP prior, and costs of which no more is known than their rows.
  };
  Kind kind = Kind::kOther;
  std::string term;    ///< Name of the cost, or "gp_prior".
  double cost = 0.0;   ///< 1/2 the sum of its squares over the stretch.
  double share = 0.0;  ///< Of the cost of the whole trajectory.
  /// A collision, a limit exceeded or an end missed, as opposed to a cost that is merely felt.
  bool broken = false;

  std::string subject;  ///< A link or a joint; what a row of the cost measures, or its number.
  std::string other;    ///< What it meets: an obstacle, a link, a limit, an end.
  double amount = 0.0;  ///< How far inside, beyond or off; negative: by how much it is clear.
  std::string unit;     ///< Of the amount: m, rad, m/s, rad/s, sigma.
  /// The nearest point of the obstacle, world frame, where the field tells of one.
  std::optional<Eigen::Vector3d> obstacle_m;

  int first_state = 0;  ///< Support states that enclose the stretch.
  int last_state = 0;
  double from_s = 0.0;
  double to_s = 0.0;
  double worst_s = 0.0;  ///< Where its residual is the largest; what amount and obstacle are of.

  /// E.g. "hand_link is 0.013 m inside an obstacle at (0.62, -0.31, 0.74) m".
  [[nodiscard]] std::string what() const;
  /// what(), when, in which states, which cost and its share of the whole.
  [[nodiscard]] std::string describe() const;
};

/// What holds a trajectory, at most eight things: what is broken first, collisions before limits,
/// then by cost; of one term and link or joint the two stretches that cost the most.
struct Explanation {
  double cost = 0.0;  ///< Of the trajectory, the GP prior included.
  std::vector<Hindrance> hindrances;
};

/// Evaluates the terms of a problem at the states of any trajectory, of any origin, and tells
/// what holds it: per term and per link, pair of links or joint, each stretch of neighbouring
/// states at which it costs anything. Rows of the terms "obstacle", "floor",
/// "self_collision", "position_limit", "velocity_limit", "start", "goal" and "goal_velocity" are
/// those of planning/costs.hpp; rows of any other term are what the cost calls them
/// (residual_names.hpp), or named by their number. Fails with kInvalidArgument where the trajectory
/// is malformed or not of the problem's robot. [any]; allocates.
[[nodiscard]] Result<Explanation> explain(const Problem& problem, const Trajectory& trajectory);

/// The same of a single configuration (dof values) at rest, by the terms that are felt at every
/// state: why a start or a goal cannot be used. Fails likewise.
[[nodiscard]] Result<Explanation> explain_state(const Problem& problem, std::span<const double> q);

}  // namespace sidestep
