#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Positions, or any values of them, of joints at waypoints: dof rows, a column per waypoint.
using Waypoints = Eigen::MatrixXd;

/// A trajectory whose only variables are the positions at a problem's support states, its
/// waypoints. The velocity at a waypoint is the central difference of its neighbours, at both ends
/// that of the problem's start and goal; between waypoints the motion is the cubic that every
/// Trajectory is. Methods of one object: one thread at a time.
class WaypointStates {
 public:
  /// The problem must be valid and outlive the object.
  explicit WaypointStates(const Problem& problem);

  [[nodiscard]] int dof() const noexcept { return dof_; }
  [[nodiscard]] int waypoints() const noexcept { return waypoints_; }
  /// Waypoints and the problem's interpolated checks between them.
  [[nodiscard]] int states() const noexcept { return (waypoints_ - 1) * step() + 1; }
  /// States from one waypoint to the next: waypoint i is state i * step().
  [[nodiscard]] int step() const noexcept { return checks_ + 1; }

  /// The positions of a trajectory with as many states, with start and goal of the problem at its
  /// ends.
  [[nodiscard]] Waypoints positions_of(const Trajectory& trajectory) const;

  /// Takes up positions. Does not allocate.
  void update(const Waypoints& positions);

  /// The waypoints, and all states in order of time, as of the last update().
  [[nodiscard]] StateBatch at_waypoints() const noexcept;
  [[nodiscard]] StateBatch everywhere() const noexcept;
  [[nodiscard]] StateBatch at_waypoint(int i) const noexcept;

  /// Adds to `by_waypoint` the gradient by the positions of all waypoints, ends included, of a
  /// function whose gradients at every state by position and velocity are given (dof x states()).
  void pull_back(const Eigen::MatrixXd& by_q, const Eigen::MatrixXd& by_qdot,
                 Waypoints& by_waypoint) const;

  /// What a waypoint contributes to the position and to the velocity of a state, which is the same
  /// for all joints.
  struct Share {
    int waypoint;
    double of_q;
    double of_qdot;
  };
  /// All shares in a state: four at most, in order of waypoints.
  [[nodiscard]] std::span<const Share> shares(int state) const noexcept;

  [[nodiscard]] Trajectory trajectory() const;

 private:
  /// Of cubic interpolation at a check: the weights of both positions and velocities.
  struct Basis {
    double q[4];
    double qdot[4];
  };

  void find_shares();

  int dof_;
  int checks_;
  int waypoints_;
  double dt_s_;
  RobotState start_, goal_;
  std::vector<Basis> between_;
  std::vector<Share> shares_;
  std::vector<std::size_t> first_share_;
  Eigen::MatrixXd support_q_, support_qdot_, all_q_, all_qdot_;
  std::vector<double> support_times_s_, all_times_s_;
};

}  // namespace sidestep
