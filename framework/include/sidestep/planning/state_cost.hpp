#pragma once

#include <span>
#include <string_view>

#include <sidestep/core/export.hpp>
#include <sidestep/core/scratch.hpp>

namespace sidestep {

/// A batch of n states of a robot with d joints; spans hold n x d values, row by row.
struct StateBatch {
  int count = 0;
  int dof = 0;
  std::span<const double> q;
  std::span<const double> qdot;
  std::span<const double> times_s;  ///< n, from the start of the trajectory.
};

/// Where the results of a batch go, all row by row. A span that is not wanted is empty.
struct CostBatch {
  std::span<double> residuals;      ///< n x m, whitened: cost = 1/2 sum of squares.
  std::span<double> jacobian_q;     ///< n x m x d.
  std::span<double> jacobian_qdot;  ///< n x m x d.
};

class StateNormals;
struct StateRange;

/// One cost term of one state at one time. Optimisers know nothing else of a problem but the
/// GP prior. Immutable; every method is [any], each thread with its own Scratch.
class SIDESTEP_EXPORT StateCost {
 public:
  virtual ~StateCost() = default;

  /// Stable, lower case, e.g. "obstacle"; names the term in results.
  [[nodiscard]] virtual std::string_view name() const noexcept = 0;

  /// Residuals of one state (m), constant.
  [[nodiscard]] virtual int residual_count() const noexcept = 0;

  /// False if every jacobian_qdot is zero: optimisers then neither ask for it nor store it.
  [[nodiscard]] virtual bool depends_on_velocity() const noexcept = 0;

  /// Residuals and Jacobians of a batch. Every element of a non-empty span is written.
  virtual void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const = 0;

  /// Adds J^T J and J^T r of a batch to those of its states, and returns the cost, 1/2 the sum of
  /// squares. The same as evaluate() says, of which by default it is made; costs of which most rows
  /// are zero form only the others here. Where it costs more than out.rows_wanted_below(), what is
  /// added is never read.
  virtual double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                           Scratch& scratch) const;
};

}  // namespace sidestep
