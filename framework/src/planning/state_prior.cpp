#include <algorithm>
#include <string>
#include <utility>

#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {
namespace {

class StatePrior final : public StateCost, public HasCostForm {
 public:
  StatePrior(std::string name, RobotState target, double sigma)
      : name_(std::move(name)), target_(std::move(target)), weight_(1.0 / sigma) {}

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(2 * target_.q.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return true; }
  [[nodiscard]] CostForm form() const override {
    const Eigen::VectorXd weights = Eigen::VectorXd::Constant(target_.q.size(), weight_);
    return TargetForm{target_.q, weights, target_.qdot, weights};
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    const auto d = static_cast<std::size_t>(states.dof);
    for (std::size_t i = 0; i < static_cast<std::size_t>(states.count); ++i) {
      for (std::size_t j = 0; j < d; ++j) {
        const auto joint = static_cast<Eigen::Index>(j);
        const std::size_t position = i * 2 * d + j;  // row of the position's residual
        const std::size_t velocity = position + d;
        if (!out.residuals.empty()) {
          out.residuals[position] = weight_ * (states.q[i * d + j] - target_.q[joint]);
          out.residuals[velocity] = weight_ * (states.qdot[i * d + j] - target_.qdot[joint]);
        }
        if (!out.jacobian_q.empty()) out.jacobian_q[position * d + j] = weight_;
        if (!out.jacobian_qdot.empty()) out.jacobian_qdot[velocity * d + j] = weight_;
      }
    }
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    double sum = 0.0;
    const auto d = static_cast<std::size_t>(states.dof);
    for (std::size_t i = 0; i < static_cast<std::size_t>(states.count); ++i) {
      for (std::size_t j = 0; j < d; ++j) {
        const auto joint = static_cast<Eigen::Index>(j);
        const double position = weight_ * (states.q[i * d + j] - target_.q[joint]);
        const double velocity = weight_ * (states.qdot[i * d + j] - target_.qdot[joint]);
        out.add_position_entry(range[i], j, weight_, position);
        out.add_velocity_entry(range[i], j, weight_, velocity);
        sum += position * position + velocity * velocity;
      }
    }
    return 0.5 * sum;
  }

 private:
  std::string name_;
  RobotState target_;
  double weight_;
};

}  // namespace

std::unique_ptr<StateCost> make_state_prior(std::string name, RobotState target, double sigma) {
  return std::make_unique<StatePrior>(std::move(name), std::move(target), sigma);
}

}  // namespace sidestep
