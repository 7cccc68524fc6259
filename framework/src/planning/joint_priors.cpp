#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {
namespace {

/// Joints towards values of their own: (value - target) / sigma, of positions or of velocities.
class JointPrior : public StateCost, public HasCostForm {
 public:
  JointPrior(std::string name, bool of_velocity, Eigen::VectorXd target, Eigen::VectorXd weights)
      : name_(std::move(name)),
        of_velocity_(of_velocity),
        target_(std::move(target)),
        weights_(std::move(weights)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(target_.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return of_velocity_; }
  [[nodiscard]] CostForm form() const override {
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(target_.size());
    return of_velocity_ ? TargetForm{none, none, target_, weights_}
                        : TargetForm{target_, weights_, none, none};
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    const std::span<double> jacobian = of_velocity_ ? out.jacobian_qdot : out.jacobian_q;
    const auto d = static_cast<std::size_t>(states.dof);
    for (std::size_t i = 0; i < d * static_cast<std::size_t>(states.count); ++i) {
      if (!out.residuals.empty()) out.residuals[i] = residual(states, i);
      if (!jacobian.empty()) jacobian[i * d + i % d] = weights_[static_cast<Eigen::Index>(i % d)];
    }
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    double sum = 0.0;
    const auto d = static_cast<std::size_t>(states.dof);
    for (std::size_t i = 0; i < d * static_cast<std::size_t>(states.count); ++i) {
      const double weight = weights_[static_cast<Eigen::Index>(i % d)];
      if (weight == 0.0) continue;
      const double at_i = residual(states, i);
      sum += at_i * at_i;
      if (of_velocity_) {
        out.add_velocity_entry(range[i / d], i % d, weight, at_i);
      } else {
        out.add_position_entry(range[i / d], i % d, weight, at_i);
      }
    }
    return 0.5 * sum;
  }

 protected:
  [[nodiscard]] double weight(int joint) const { return weights_[joint]; }

 private:
  [[nodiscard]] double residual(const StateBatch& states, std::size_t i) const {
    const auto j = static_cast<Eigen::Index>(i % static_cast<std::size_t>(states.dof));
    return weights_[j] * ((of_velocity_ ? states.qdot[i] : states.q[i]) - target_[j]);
  }

  std::string name_;
  bool of_velocity_;
  Eigen::VectorXd target_;
  Eigen::VectorXd weights_;  ///< 0 for a joint that may be anywhere.
};

class Posture final : public JointPrior, public NamesResiduals {
 public:
  Posture(const RobotDescription& robot, const Eigen::VectorXd& q, const Eigen::VectorXd& sigmas)
      : JointPrior("posture", false, q, sigmas.cwiseInverse()), joints_(robot.joints) {}

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    const Joint& joint = joints_[static_cast<std::size_t>(residual)];
    return {joint.name, "", "its preferred position", joint.unit(), 1.0 / weight(residual)};
  }

 private:
  std::vector<Joint> joints_;
};

}  // namespace

Result<std::unique_ptr<StateCost>> make_posture_cost(const RobotDescription& robot,
                                                     const Eigen::VectorXd& q,
                                                     const Eigen::VectorXd& sigmas) {
  if (q.size() != robot.dof() || sigmas.size() != robot.dof()) {
    return invalid("a posture of " + std::to_string(q.size()) + " positions and " +
                   std::to_string(sigmas.size()) + " standard deviations, but " + robot.name +
                   " has " + std::to_string(robot.dof()) + " joints");
  }
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const std::string& joint = robot.joints[static_cast<std::size_t>(j)].name;
    if (!std::isfinite(q[j])) {
      return invalid("the posture wanted of joint " + joint + " is not finite");
    }
    if (!(sigmas[j] > 0.0)) {
      return invalid("the standard deviation of the posture of joint " + joint +
                     " must be positive");
    }
  }
  return std::make_unique<Posture>(robot, q, sigmas);
}

std::unique_ptr<StateCost> make_velocity_prior(std::string name, Eigen::VectorXd qdot,
                                               double sigma) {
  Eigen::VectorXd weights = Eigen::VectorXd::Constant(qdot.size(), 1.0 / sigma);
  return std::make_unique<JointPrior>(std::move(name), true, std::move(qdot), std::move(weights));
}

}  // namespace sidestep
