#pragma once

#include <memory>
#include <string_view>
#include <utility>

#include <sidestep/planning/problem.hpp>

namespace sidestep::testing_support {

/// A cost that is linearised from what it evaluates to, in double precision, where obstacles' own
/// way places spheres in single precision.
class InDoubles final : public StateCost {
 public:
  explicit InDoubles(std::shared_ptr<const StateCost> cost) : cost_(std::move(cost)) {}
  [[nodiscard]] std::string_view name() const noexcept override { return cost_->name(); }
  [[nodiscard]] int residual_count() const noexcept override { return cost_->residual_count(); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override {
    return cost_->depends_on_velocity();
  }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    cost_->evaluate(states, out, scratch);
  }

 private:
  std::shared_ptr<const StateCost> cost_;
};

/// For what is compared more closely than single precision allows.
[[nodiscard]] inline Problem linearised_in_doubles(Problem problem) {
  for (CostTerm& term : problem.terms) term.cost = std::make_shared<InDoubles>(term.cost);
  return problem;
}

}  // namespace sidestep::testing_support
