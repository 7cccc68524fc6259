#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include <ceres/cost_function.h>

#include <sidestep/planning/problem.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

namespace sidestep {

/// Every cost term of a problem, evaluated at every state of a chain in batches, as the rows
/// [dr/dq, dr/dqdot, r] of a least-squares problem, state by state.
///
/// States are in the order of time: support state i is state i * (interpolated_checks + 1).
/// The number of rows of a state never changes. Where its terms have more active residuals
/// than columns, the rows are the R factor of their QR decomposition, which has the same cost,
/// gradient and Gauss-Newton Hessian: an arm with 40 spheres gives 9 rows instead of 40.
class StateRows {
 public:
  StateRows(const Problem& problem, const GpPrior& prior);

  [[nodiscard]] int dof() const noexcept { return dof_; }
  [[nodiscard]] int state_count() const noexcept { return static_cast<int>(begin_.size()) - 1; }
  [[nodiscard]] int checks() const noexcept { return checks_; }
  [[nodiscard]] int row_count(int state) const noexcept {
    const auto s = static_cast<std::size_t>(state);
    return static_cast<int>(begin_[s + 1] - begin_[s]);
  }
  /// The interpolation at check 0 <= k < checks() of every interval.
  [[nodiscard]] const GpPrior::Interpolation& interpolation(int check) const noexcept {
    return interpolations_[static_cast<std::size_t>(check)];
  }

  /// Evaluates all terms. `support`: [q; qdot] of each support state, one after the other.
  void update(std::span<const double> support);

  /// The rows of a state at the last update: row_count(state) x (2 dof + 1), row by row.
  [[nodiscard]] std::span<const double> rows(int state) const noexcept;

  /// 1/2 sum of squares of problem.terms[term] at the last update.
  [[nodiscard]] double term_cost(std::size_t term) const noexcept;

 private:
  struct States {
    std::vector<double> q, qdot, times_s;
    [[nodiscard]] StateBatch batch(int first, int count, int dof) const noexcept;
  };
  struct Term {
    const StateCost* cost;
    Placement placement;
    std::size_t residuals_per_state;
    bool depends_on_velocity;
    std::vector<double> residuals, jacobian_q, jacobian_qdot;
  };

  [[nodiscard]] StateBatch batch_of(Placement placement) const noexcept;
  /// The index of a state in a placement's batch; -1 if the placement leaves it out.
  [[nodiscard]] int index_in(Placement placement, int state) const noexcept;
  void interpolate(std::span<const double> support);
  void pack(int state);
  double* pack_group(int state, bool velocity, double* out);
  [[nodiscard]] std::size_t group_rows(int state, bool velocity) const noexcept;

  int dof_;
  int checks_;
  int intervals_;
  double dt_s_;
  std::vector<GpPrior::Interpolation> interpolations_;
  States support_, all_;
  std::vector<Term> terms_;
  std::vector<std::size_t> begin_;  ///< First row of each state, and the end.
  std::vector<double> rows_;
  std::vector<double> work_;  ///< Active rows of one state, column by column.
  Scratch scratch_;
};

/// Turns `a` (rows x columns, column by column with the given stride) into the R factor of its
/// QR decomposition by Householder reflections; what lies below the diagonal is left undefined.
void reduce_to_r(double* a, std::size_t rows, std::size_t columns, std::size_t stride) noexcept;

/// The whitened GP prior between two support states (numerics: GP trajectory, e_i).
class GpPriorFactor final : public ceres::CostFunction {
 public:
  explicit GpPriorFactor(const GpPrior& prior);
  bool Evaluate(double const* const* states, double* residuals, double** jacobians) const override;

 private:
  const GpPrior& prior_;
};

/// The rows of all states interpolated between two support states, by the chain rule on both.
class IntervalFactor final : public ceres::CostFunction {
 public:
  /// `first`: the state (in the order of StateRows) of the first interpolated one.
  IntervalFactor(const StateRows& rows, int first);
  bool Evaluate(double const* const* states, double* residuals, double** jacobians) const override;

 private:
  const StateRows& rows_;
  int first_;
};

}  // namespace sidestep
