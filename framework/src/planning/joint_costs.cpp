#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/residual_names.hpp>
#include <sidestep/planning/state_normals.hpp>
#include <sidestep/trajectory/rolling.hpp>

namespace sidestep {
namespace {

/// The positions or the velocities of states, each beyond an interval of its own.
class LimitCost final : public StateCost, public HasCostForm {
 public:
  LimitCost(bool of_velocity, std::vector<double> lower, std::vector<double> upper, double sigma)
      : of_velocity_(of_velocity),
        lower_(std::move(lower)),
        upper_(std::move(upper)),
        weight_(1.0 / sigma) {}

  [[nodiscard]] std::string_view name() const noexcept override {
    return of_velocity_ ? "velocity_limit" : "position_limit";
  }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(lower_.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return of_velocity_; }
  [[nodiscard]] CostForm form() const override {
    const auto as_vector = [](const std::vector<double>& values) {
      return Eigen::VectorXd::Map(values.data(), std::ssize(values)).eval();
    };
    return LimitForm{of_velocity_, as_vector(lower_), as_vector(upper_), 1.0 / weight_};
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    const auto values = of_velocity_ ? states.qdot : states.q;
    const auto jacobian = of_velocity_ ? out.jacobian_qdot : out.jacobian_q;
    const std::size_t d = lower_.size();
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    for (std::size_t i = 0; i < values.size(); ++i) {
      const std::size_t j = i % d;
      const double below = lower_[j] - values[i];
      const double above = values[i] - upper_[j];
      const bool inside = below <= 0.0 && above <= 0.0;  // false for NaN
      if (!out.residuals.empty())
        out.residuals[i] = inside ? 0.0 : weight_ * std::max(above, below);
      if (!jacobian.empty() && !inside) jacobian[i * d + j] = above > below ? weight_ : -weight_;
    }
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    const auto values = of_velocity_ ? states.qdot : states.q;
    const std::size_t d = lower_.size();
    double sum = 0.0;
    for (std::size_t first = 0; first < values.size(); first += d) {
      for (std::size_t j = 0; j < d; ++j) {
        const double below = lower_[j] - values[first + j];
        const double above = values[first + j] - upper_[j];
        if (below <= 0.0 && above <= 0.0) continue;
        const double residual = weight_ * std::max(above, below);
        sum += residual * residual;
        const auto add =
            of_velocity_ ? &StateNormals::add_velocity_entry : &StateNormals::add_position_entry;
        (out.*add)(range[first / d], j, above > below ? weight_ : -weight_, residual);
      }
    }
    return 0.5 * sum;
  }

 private:
  bool of_velocity_;
  std::vector<double> lower_;
  std::vector<double> upper_;
  double weight_;
};

/// Joints towards values of their own: (value - target) / sigma of positions, of velocities, or of
/// each state first of the ones and then of the others.
class TargetPrior : public StateCost, public HasCostForm {
 public:
  TargetPrior(std::string name, bool of_position, bool of_velocity, TargetForm target)
      : name_(std::move(name)),
        of_position_(of_position),
        of_velocity_(of_velocity),
        target_(std::move(target)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return name_; }
  [[nodiscard]] int residual_count() const noexcept override {
    return (of_position_ + of_velocity_) * static_cast<int>(target_.q.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return of_velocity_; }
  [[nodiscard]] CostForm form() const override { return target_; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    const std::size_t d = idx(states.dof);
    std::size_t row = 0;
    const auto put = [&](std::span<const double> values, const Eigen::VectorXd& target,
                         const Eigen::VectorXd& weights, std::span<double> jacobian) {
      for (std::size_t j = 0; j < d; ++j, ++row) {
        if (!out.residuals.empty()) out.residuals[row] = weights[j] * (values[j] - target[j]);
        if (!jacobian.empty()) jacobian[row * d + j] = weights[j];
      }
    };
    for (std::size_t i = 0; i < idx(states.count); ++i) {
      if (of_position_) {
        put(states.q.subspan(i * d, d), target_.q, target_.q_weights, out.jacobian_q);
      }
      if (of_velocity_) {
        put(states.qdot.subspan(i * d, d), target_.qdot, target_.qdot_weights, out.jacobian_qdot);
      }
    }
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch&) const override {
    double sum = 0.0;
    const std::size_t d = idx(states.dof);
    for (std::size_t k = 0; k < d * idx(states.count); ++k) {
      const std::size_t i = range[k / d], j = k % d;
      double position = 0.0, velocity = 0.0;
      if (const double weight = target_.q_weights[j]; weight != 0.0) {
        position = weight * (states.q[k] - target_.q[j]);
        out.add_position_entry(i, j, weight, position);
      }
      if (const double weight = target_.qdot_weights[j]; weight != 0.0) {
        velocity = weight * (states.qdot[k] - target_.qdot[j]);
        out.add_velocity_entry(i, j, weight, velocity);
      }
      sum += position * position + velocity * velocity;
    }
    return 0.5 * sum;
  }

 protected:
  [[nodiscard]] const TargetForm& target() const noexcept { return target_; }

 private:
  std::string name_;
  bool of_position_;
  bool of_velocity_;
  TargetForm target_;  ///< Weights are 0 for a joint that may be anywhere.
};

/// How fast a rolling base moves across its wheels.
class Sideways final : public StateCost {
 public:
  Sideways(const RollingBase& base, double sigma_mps) : base_(base), weight_(1.0 / sigma_mps) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "sideways"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return true; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    const std::size_t d = idx(states.dof);
    const std::size_t x = idx(base_.x), y = idx(base_.y), yaw = idx(base_.yaw);
    for (std::size_t i = 0; i < idx(states.count); ++i) {
      const auto q = states.q.subspan(i * d, d), qdot = states.qdot.subspan(i * d, d);
      const BaseSpeed speed = base_speed(base_, q, qdot);
      if (!out.residuals.empty()) out.residuals[i] = weight_ * speed.left_mps;
      if (!out.jacobian_q.empty()) out.jacobian_q[i * d + yaw] = -weight_ * speed.ahead_mps;
      if (out.jacobian_qdot.empty()) continue;
      out.jacobian_qdot[i * d + x] = -weight_ * std::sin(q[yaw]);
      out.jacobian_qdot[i * d + y] = weight_ * std::cos(q[yaw]);
    }
  }

 private:
  RollingBase base_;
  double weight_;
};

class Posture final : public TargetPrior, public NamesResiduals {
 public:
  Posture(const RobotDescription& robot, const Eigen::VectorXd& q, const Eigen::VectorXd& sigmas)
      : TargetPrior("posture", true, false,
                    {q, sigmas.cwiseInverse(), Eigen::VectorXd::Zero(q.size()),
                     Eigen::VectorXd::Zero(q.size())}),
        joints_(robot.joints) {}

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    const Joint& joint = joints_[idx(residual)];
    return {joint.name, "", "its preferred position", joint.unit(),
            1.0 / target().q_weights[residual]};
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
    const std::string& joint = robot.joints[idx(j)].name;
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

Result<std::unique_ptr<StateCost>> make_sideways_cost(const RobotDescription& robot,
                                                      double sigma_mps) {
  if (!robot.rolling) return invalid(robot.name + " has no base that rolls");
  if (!(sigma_mps > 0.0)) {
    return invalid("the standard deviation of the speed across the wheels must be positive");
  }
  return std::make_unique<Sideways>(*robot.rolling, sigma_mps);
}

std::unique_ptr<StateCost> make_velocity_prior(std::string name, Eigen::VectorXd qdot,
                                               double sigma) {
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(qdot.size());
  Eigen::VectorXd weights = Eigen::VectorXd::Constant(qdot.size(), 1.0 / sigma);
  return std::make_unique<TargetPrior>(std::move(name), false, true,
                                       TargetForm{none, none, std::move(qdot), std::move(weights)});
}

std::unique_ptr<StateCost> make_state_prior(std::string name, RobotState target, double sigma) {
  const Eigen::VectorXd weights = Eigen::VectorXd::Constant(target.q.size(), 1.0 / sigma);
  return std::make_unique<TargetPrior>(
      std::move(name), true, true,
      TargetForm{std::move(target.q), weights, std::move(target.qdot), weights});
}

std::unique_ptr<StateCost> make_position_limit_cost(std::shared_ptr<const RobotModel> robot,
                                                    double margin, double sigma) {
  std::vector<double> lower, upper;
  for (const Joint& joint : robot->description().joints) {
    const double inset = std::min(margin, 0.5 * (joint.upper - joint.lower));
    lower.push_back(joint.lower + inset);
    upper.push_back(joint.upper - inset);
  }
  return std::make_unique<LimitCost>(false, std::move(lower), std::move(upper), sigma);
}

std::unique_ptr<StateCost> make_velocity_limit_cost(std::shared_ptr<const RobotModel> robot,
                                                    double speed_fraction, double sigma) {
  std::vector<double> lower, upper;
  for (const Joint& joint : robot->description().joints) {
    upper.push_back(speed_fraction * joint.max_velocity);
    lower.push_back(-upper.back());
  }
  return std::make_unique<LimitCost>(true, std::move(lower), std::move(upper), sigma);
}

}  // namespace sidestep
