#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include <sidestep/core/scratch.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/planning/state_normals.hpp>
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

/// The cost terms of a problem at waypoints, but for some that an optimiser has its own way with.
/// One thread at a time.
class WaypointTerms {
 public:
  /// `left_out`: names of terms. The problem must outlive the object.
  WaypointTerms(const Problem& problem, std::vector<std::string_view> left_out);

  /// Their cost; adds its gradient by all waypoints to `gradient`.
  [[nodiscard]] double add_gradient(const WaypointStates& states, Waypoints& gradient);
  /// Their cost, and their normal equations at every state.
  [[nodiscard]] double linearise(const WaypointStates& states, StateNormals& normals);
  /// Adds the cost of each state, computed without any derivative, to `costs` (states.states()).
  void add_costs(const WaypointStates& states, std::vector<double>& costs);

 private:
  const Problem* problem_;
  std::vector<const CostTerm*> terms_;
  StateNormals normals_;
  Eigen::MatrixXd by_q_, by_qdot_;
  Scratch scratch_;
};

/// The cost of every term of a problem, the GP prior first as "gp_prior", without derivatives.
[[nodiscard]] std::vector<TermCost> term_costs(const Problem& problem,
                                               const WaypointStates& states);

/// Of what the square is summed.
enum class Derivative { kVelocity, kAcceleration };
/// By the name that a parameter gives it: "velocity", else acceleration.
[[nodiscard]] Derivative derivative_of(std::string_view name) noexcept;

/// How smooth waypoints are, by finite differences (Zucker 2013, section 3.1): over the time of the
/// motion taken as 1, half the integral of the squared derivative,
///
///     F(q) = 1/2 sum_j w_j |K q_j + e_j|^2,   A = K^T K,
///
/// with w_j the largest qc over that of joint j. It therefore depends neither on the time between
/// waypoints nor on the number of them, up to the error of the differences. Accelerations are
/// second differences; those at the ends are made with the velocities of start and goal, for which
/// the neighbour beyond an end is the one that makes the central difference that velocity, and
/// count half (trapezoidal rule). The ends are fixed: A is that of the waypoints between them.
/// [any]; allocates.
class DifferenceMetric {
 public:
  DifferenceMetric(const Problem& problem, Derivative derivative);

  /// False where A is not positive definite in double precision; nothing else may be called then.
  [[nodiscard]] bool is_usable() const noexcept { return factor_.info() == Eigen::Success; }

  [[nodiscard]] double cost(const Waypoints& positions) const;
  /// Adds weight times the gradient by all waypoints, ends included.
  void add_gradient(const Waypoints& positions, double weight, Waypoints& gradient) const;

  /// A^-1 x, joint by joint and without the weights w_j, of the inner waypoints: dof x inner().
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& x) const;
  /// L^-T z for A = L L^T: with z standard normal, a sample of N(0, A^-1) per joint.
  [[nodiscard]] Eigen::MatrixXd colour(const Eigen::MatrixXd& z) const;

  [[nodiscard]] int inner() const noexcept { return static_cast<int>(a_.cols()); }
  [[nodiscard]] const Eigen::SparseMatrix<double>& a() const noexcept { return a_; }
  /// w_j of each joint, at least 1.
  [[nodiscard]] const Eigen::VectorXd& joint_weights() const noexcept { return weights_; }

 private:
  Eigen::SparseMatrix<double> k_;  ///< Rows x waypoints.
  Eigen::MatrixXd e_;              ///< dof x rows.
  Eigen::SparseMatrix<double> a_;  ///< Inner waypoints only.
  Eigen::VectorXd weights_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>, Eigen::Lower, Eigen::NaturalOrdering<int>>
      factor_;
};

/// The positions that waypoints may have: the joints' limits, narrowed by `margin` on both sides
/// (m, rad; no more than leaves start, goal and half the range free).
struct JointBounds {
  Eigen::VectorXd lower, upper;

  JointBounds(const Problem& problem, double margin);

  [[nodiscard]] bool contain(const Waypoints& positions) const;
};

/// Brings the inner waypoints within bounds as smoothly as the metric allows (Zucker 2013, section
/// 3.4): adds A^-1 v, v the violations of a joint, scaled to take back the largest of them, until
/// there are none. What is left of them after as many rounds as there are waypoints is cut off.
void keep_within(const JointBounds& bounds, const DifferenceMetric& metric, Waypoints& positions);

/// How a search over waypoints ended, in its own objective.
struct SearchEnd {
  SolveStatus status = SolveStatus::kConverged;
  int iterations = 0;
  int accepted = 0;
  double objective = 0.0;
  double last_decrease = 0.0;  ///< Of the objective, by the last accepted iteration.
  std::string reason;          ///< Of kFailed, or of a limit other than that of iterations.
};

/// Looks for better waypoints of one problem.
class WaypointSearch {
 public:
  virtual ~WaypointSearch() = default;
  /// Takes up waypoints; false if their objective is not a finite number.
  [[nodiscard]] virtual bool begin(Waypoints initial) = 0;
  [[nodiscard]] virtual SearchEnd run(const Deadline& deadline) = 0;
  [[nodiscard]] virtual const Waypoints& best() const noexcept = 0;
};

/// What an optimiser that moves waypoints between two fixed ends is made of.
struct WaypointMethod {
  std::string name;
  Derivative smoothness;  ///< Of the metric.
  int max_iterations;
  /// Makes a search; problem and metric outlive it.
  std::function<std::unique_ptr<WaypointSearch>(const Problem&, const DifferenceMetric&)> search;
};

/// Its solutions have the costs of the problem's terms. A search that was interrupted hands out the
/// initial waypoints where those cost the problem less, for its own objective need not fall
/// together with it.
[[nodiscard]] std::unique_ptr<Optimiser> make_waypoint_optimiser(WaypointMethod method);

}  // namespace sidestep
