#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include <sidestep/core/export.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {

/// What a problem costs as a function of its support states, and how that changes nearby: for
/// optimisers that move these states, whatever their method. The variables x are [q; qdot] of one
/// support state after the other; the GP prior says where the states between two of them are, which
/// costs see as well (docs/numerics.md). An end at which no term is placed stays where the problem
/// has it. One thread at a time; allocates.
class SIDESTEP_EXPORT TrajectoryObjective {
 public:
  /// The cost 1/2 |r(x)|^2 near an x.
  struct Expansion {
    std::vector<TermCost> terms;  ///< The GP prior first, as "gp_prior".
    double cost = 0.0;            ///< Of all of them.
    Eigen::VectorXd gradient;     ///< J^T r; 0 of an end that stays.
    /// J^T J, block tridiagonal, both triangles; the unit matrix of an end that stays.
    Eigen::SparseMatrix<double> hessian;
  };

  /// The problem must be valid (Problem::validate()) and outlive the object.
  explicit TrajectoryObjective(const Problem& problem);

  /// The number of variables.
  [[nodiscard]] Eigen::Index size() const noexcept { return 2 * dof_ * states_; }
  /// The variables of a trajectory that check_initial() accepts, its ends where they have to stay.
  [[nodiscard]] Eigen::VectorXd variables_of(const Trajectory& trajectory) const;
  [[nodiscard]] Trajectory trajectory_of(const Eigen::VectorXd& x) const;

  /// The cost of each term, as in Expansion, without any derivative.
  [[nodiscard]] std::vector<TermCost> costs(const Eigen::VectorXd& x);
  [[nodiscard]] Expansion expand(const Eigen::VectorXd& x);

 private:
  /// The states that one term sees, as it is given them.
  struct Seen {
    StateRange range;
    Eigen::MatrixXd q, qdot;
    Eigen::VectorXd times_s;

    [[nodiscard]] StateBatch batch() const noexcept;
  };

  [[nodiscard]] Eigen::Index step() const noexcept { return problem_.interpolated_checks + 1; }
  [[nodiscard]] Eigen::Index all_states() const noexcept { return (states_ - 1) * step() + 1; }
  [[nodiscard]] Eigen::Index interval_of(Eigen::Index state) const noexcept;
  /// [q; qdot] of a state by those of both ends of its interval.
  [[nodiscard]] const Eigen::MatrixXd& weights_of(Eigen::Index state) const noexcept;
  [[nodiscard]] Eigen::MatrixXd everywhere(const Eigen::VectorXd& x) const;
  [[nodiscard]] Seen seen_by(const CostTerm& term, const Eigen::MatrixXd& all) const;
  [[nodiscard]] double prior_cost(const Eigen::VectorXd& x) const;
  /// J^T J of each interval, and J^T r, of terms and prior.
  void add_states(std::vector<Eigen::MatrixXd>& intervals, Eigen::VectorXd& gradient) const;
  void hold_ends(Expansion& expansion) const;

  const Problem& problem_;
  Eigen::Index dof_, states_;
  std::vector<Eigen::MatrixXd> between_;  ///< From the begin of an interval to its end.
  Eigen::MatrixXd prior_rows_;            ///< Of one interval, whitened.
  bool start_stays_, goal_stays_;
  StateNormals normals_;
  Scratch scratch_;
};

}  // namespace sidestep
