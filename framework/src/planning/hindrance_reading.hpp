#pragma once

#include <vector>

#include <sidestep/planning/explain.hpp>

#include "residual_groups.hpp"

namespace sidestep {

/// States of a trajectory, row by row, with their times and their places in units of support
/// states.
struct StateRows {
  int dof;
  std::vector<double> q, qdot, times_s, place;

  [[nodiscard]] std::size_t size() const noexcept { return times_s.size(); }
  [[nodiscard]] StateBatch batch() const noexcept {
    return {static_cast<int>(size()), dof, q, qdot, times_s};
  }
  [[nodiscard]] std::span<const double> q_of(std::size_t state) const noexcept {
    const auto d = static_cast<std::size_t>(dof);
    return std::span(q).subspan(state * d, d);
  }
  void add(std::span<const double> q_row, std::span<const double> qdot_row, double time_s,
           double at) {
    q.insert(q.end(), q_row.begin(), q_row.end());
    qdot.insert(qdot.end(), qdot_row.begin(), qdot_row.end());
    times_s.push_back(time_s);
    place.push_back(at);
  }
};

/// Knows what the residuals of a cost mean, where it is one of planning/costs.hpp or names them.
class HindranceReading {
 public:
  HindranceReading(const Problem& problem, const CostTerm& term);

  /// Residuals that are told of together: the spheres of a link, a pair of links, a joint.
  [[nodiscard]] const std::vector<std::vector<std::size_t>>& groups() const noexcept {
    return groups_;
  }
  /// Fills in kind, subject, other, amount, unit, obstacle and whether it is broken, from one
  /// residual, in `row`, of all of those of one state.
  void tell(const StateRows& rows, std::size_t state, std::size_t row,
            std::span<const double> residuals, Hindrance& out) const;

 private:
  enum class Meaning {
    kObstacle,
    kFloor,
    kSelfCollision,
    kPositionLimit,
    kVelocityLimit,
    kStart,
    kGoal,
    kGoalVelocity,
    kNamed
  };
  [[nodiscard]] static Meaning meaning_of(const Problem& problem, const StateCost& cost);

  void tell_obstacle(std::span<const double> q, std::size_t sphere, Hindrance& out) const;
  void tell_floor(std::span<const double> q, std::size_t sphere, Hindrance& out) const;
  void tell_self_collision(std::span<const double> q, std::size_t pair, Hindrance& out) const;
  void tell_position(double q, std::size_t joint, Hindrance& out) const;
  void tell_velocity(double qdot, std::size_t joint, Hindrance& out) const;
  void tell_endpoint(const StateRows& rows, std::size_t state, std::size_t row,
                     Hindrance& out) const;
  void tell_named(std::size_t row, std::span<const double> residuals, Hindrance& out) const;

  const Problem& problem_;
  const RobotDescription& robot_;
  Meaning meaning_;
  bool is_at_goal_;
  std::vector<std::vector<std::size_t>> groups_;
  std::vector<int> above_floor_;      ///< Spheres of kFloor's residuals.
  std::vector<ResidualGroup> named_;  ///< Of kNamed, as groups_.
};

}  // namespace sidestep
