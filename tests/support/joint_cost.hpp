#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

#include <sidestep/planning/state_cost.hpp>

namespace sidestep::testing_support {

/// A cost of one residual a state, which is a function of the second joint alone.
class JointCost final : public StateCost {
 public:
  struct Value {
    double residual;
    double slope;
  };

  explicit JointCost(std::function<Value(double q)> function) : function_(std::move(function)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "joint"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.jacobian_q, 0.0);
    const auto dof = static_cast<std::size_t>(states.dof);
    for (std::size_t i = 0; i < out.residuals.size(); ++i) {
      const Value value = function_(states.q[i * dof + 1]);
      out.residuals[i] = value.residual;
      if (!out.jacobian_q.empty()) out.jacobian_q[i * dof + 1] = value.slope;
    }
  }

 private:
  std::function<Value(double q)> function_;
};

}  // namespace sidestep::testing_support
