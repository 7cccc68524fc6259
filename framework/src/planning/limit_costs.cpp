#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {
namespace {

/// The hinge of each value of a state beyond an interval of its own; its Jacobian is diagonal.
class IntervalHinge {
 public:
  IntervalHinge(std::vector<double> lower, std::vector<double> upper, double sigma)
      : lower_(std::move(lower)), upper_(std::move(upper)), weight_(1.0 / sigma) {}

  [[nodiscard]] int size() const noexcept { return static_cast<int>(lower_.size()); }

  [[nodiscard]] LimitForm form(bool of_velocity) const {
    const auto as_vector = [](const std::vector<double>& values) {
      return Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size())).eval();
    };
    return {of_velocity, as_vector(lower_), as_vector(upper_), 1.0 / weight_};
  }

  /// Calls add(i, joint, entry, residual) for each value beyond its limits, i in [0, n); returns
  /// 1/2 the sum of squares. values: n x d.
  template <class Add>
  double for_each_beyond(std::span<const double> values, const Add& add) const {
    const std::size_t d = lower_.size();
    double sum = 0.0;
    for (std::size_t first = 0; first < values.size(); first += d) {
      for (std::size_t j = 0; j < d; ++j) {
        const double below = lower_[j] - values[first + j];
        const double above = values[first + j] - upper_[j];
        if (below <= 0.0 && above <= 0.0) continue;
        const double residual = weight_ * std::max(above, below);
        sum += residual * residual;
        add(first / d, j, above > below ? weight_ : -weight_, residual);
      }
    }
    return 0.5 * sum;
  }

  /// values: n x d. residuals: n x d or empty. jacobian: n x d x d or empty.
  void evaluate(std::span<const double> values, std::span<double> residuals,
                std::span<double> jacobian) const noexcept {
    const std::size_t d = lower_.size();
    std::ranges::fill(jacobian, 0.0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t j = i % d;
      const double below = lower_[j] - values[i];
      const double above = values[i] - upper_[j];
      const bool inside = below <= 0.0 && above <= 0.0;  // false for NaN
      if (!residuals.empty()) residuals[i] = inside ? 0.0 : weight_ * std::max(above, below);
      if (!jacobian.empty() && !inside) jacobian[i * d + j] = above > below ? weight_ : -weight_;
    }
  }

 private:
  std::vector<double> lower_;
  std::vector<double> upper_;
  double weight_;
};

class PositionLimitCost final : public StateCost, public HasCostForm {
 public:
  explicit PositionLimitCost(IntervalHinge hinge) : hinge_(std::move(hinge)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "position_limit"; }
  [[nodiscard]] int residual_count() const noexcept override { return hinge_.size(); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  [[nodiscard]] CostForm form() const override { return hinge_.form(false); }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    hinge_.evaluate(states.q, out.residuals, out.jacobian_q);
    std::ranges::fill(out.jacobian_qdot, 0.0);
  }
  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    return hinge_.for_each_beyond(
        states.q, [&](std::size_t i, std::size_t joint, double entry, double residual) {
          out.add_position_entry(range[i], joint, entry, residual);
        });
  }

 private:
  IntervalHinge hinge_;
};

class VelocityLimitCost final : public StateCost, public HasCostForm {
 public:
  explicit VelocityLimitCost(IntervalHinge hinge) : hinge_(std::move(hinge)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "velocity_limit"; }
  [[nodiscard]] int residual_count() const noexcept override { return hinge_.size(); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return true; }
  [[nodiscard]] CostForm form() const override { return hinge_.form(true); }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    hinge_.evaluate(states.qdot, out.residuals, out.jacobian_qdot);
    std::ranges::fill(out.jacobian_q, 0.0);
  }
  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    return hinge_.for_each_beyond(
        states.qdot, [&](std::size_t i, std::size_t joint, double entry, double residual) {
          out.add_velocity_entry(range[i], joint, entry, residual);
        });
  }

 private:
  IntervalHinge hinge_;
};

}  // namespace

std::unique_ptr<StateCost> make_position_limit_cost(std::shared_ptr<const RobotModel> robot,
                                                    double margin, double sigma) {
  std::vector<double> lower, upper;
  for (const Joint& joint : robot->description().joints) {
    const double inset = std::min(margin, 0.5 * (joint.upper - joint.lower));
    lower.push_back(joint.lower + inset);
    upper.push_back(joint.upper - inset);
  }
  return std::make_unique<PositionLimitCost>(
      IntervalHinge(std::move(lower), std::move(upper), sigma));
}

std::unique_ptr<StateCost> make_velocity_limit_cost(std::shared_ptr<const RobotModel> robot,
                                                    double speed_fraction, double sigma) {
  std::vector<double> lower, upper;
  for (const Joint& joint : robot->description().joints) {
    upper.push_back(speed_fraction * joint.max_velocity);
    lower.push_back(-upper.back());
  }
  return std::make_unique<VelocityLimitCost>(
      IntervalHinge(std::move(lower), std::move(upper), sigma));
}

}  // namespace sidestep
