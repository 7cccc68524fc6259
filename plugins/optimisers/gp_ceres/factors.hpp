#pragma once

#include <ceres/cost_function.h>
#include <ceres/evaluation_callback.h>

#include <sidestep/trajectory/gp_prior.hpp>

#include "state_rows.hpp"

namespace sidestep {

/// Before each evaluation, Ceres has written the point into `support`: all costs of all states
/// are computed here in one batch, and the factors below only copy them out.
class BatchEvaluation final : public ceres::EvaluationCallback {
 public:
  BatchEvaluation(StateRows& rows, std::span<const double> support)
      : rows_(rows), support_(support) {}
  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

 private:
  StateRows& rows_;
  std::span<const double> support_;
};

/// The whitened GP prior between two support states (numerics: GP trajectory, e_i).
class GpPriorFactor final : public ceres::CostFunction {
 public:
  explicit GpPriorFactor(const GpPrior& prior);
  bool Evaluate(double const* const* states, double* residuals, double** jacobians) const override;

 private:
  const GpPrior& prior_;
};

/// The rows of one support state.
class SupportFactor final : public ceres::CostFunction {
 public:
  SupportFactor(const StateRows& rows, int state);
  bool Evaluate(double const* const* states, double* residuals, double** jacobians) const override;

 private:
  const StateRows& rows_;
  int state_;
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
