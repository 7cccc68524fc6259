#include <algorithm>
#include <cmath>

#include "damping.hpp"
#include "panel_kernels.hpp"
#include "step_rules.hpp"

namespace sidestep {
namespace {

constexpr double kLeastRadius = 1e-8;

class Dogleg final : public StepRule {
 public:
  explicit Dogleg(double initial_radius) : initial_radius_(initial_radius) {}

  void reset(std::size_t variables) override {
    radius_ = initial_radius_;
    for (auto* values : {&newton_, &cauchy_, &rhs_, &product_, &step_}) {
      values->assign(variables, 0.0);
    }
  }

  [[nodiscard]] StepOutcome iterate(ChainModel& model, const Deadline& deadline,
                                    int& tried) override {
    if (!find_directions(model.system())) {
      ++tried;
      return StepOutcome::kSingular;
    }
    while (radius_ >= kLeastRadius) {
      ++tried;
      choose_step();
      const double length = std::sqrt(dot(step_, step_));
      model.system().product(step_, product_);
      const double predicted = dot(rhs_, step_) - 0.5 * dot(step_, product_);
      const double before = model.current().cost;
      const double decrease = before - model.try_step(step_, before);
      const double fidelity = predicted > 0.0 ? decrease / predicted : 0.0;
      if (!(fidelity >= 0.25)) radius_ = 0.25 * std::min(length, radius_);
      if (fidelity > 0.75) radius_ = std::max(radius_, 3.0 * length);
      if (fidelity > kLeastFidelity) {
        model.accept();
        return StepOutcome::kAccepted;
      }
      if (deadline.expired()) return StepOutcome::kInterrupted;
    }
    return StepOutcome::kNoBetter;
  }

 private:
  /// The minimum of the model, and its minimum along steepest descent.
  [[nodiscard]] bool find_directions(ChainSystem& system) {
    if (!system.solve(0.0, newton_)) return false;
    const auto width = static_cast<std::size_t>(system.width());
    for (int i = 0; i < system.states(); ++i) {
      std::copy_n(system.rhs(i), width, rhs_.data() + static_cast<std::size_t>(i) * width);
    }
    system.product(rhs_, product_);
    const double curvature = dot(rhs_, product_);
    const double scale = curvature > 0.0 ? dot(rhs_, rhs_) / curvature : 0.0;
    std::ranges::transform(rhs_, cauchy_.begin(), [scale](double b) { return scale * b; });
    return true;
  }

  /// The point of the path 0 - cauchy - newton that is furthest along within the trust region.
  void choose_step() {
    const double newton = std::sqrt(dot(newton_, newton_));
    const double cauchy = std::sqrt(dot(cauchy_, cauchy_));
    if (newton <= radius_) {
      step_ = newton_;
    } else if (cauchy >= radius_) {
      mix(radius_ / cauchy, 0.0);
    } else {
      // |cauchy + t (newton - cauchy)|^2 = radius^2
      const double across = dot(newton_, cauchy_);
      const double a = newton * newton - 2.0 * across + cauchy * cauchy;
      const double half_b = across - cauchy * cauchy;
      const double c = cauchy * cauchy - radius_ * radius_;  // not positive
      const double t = -c / (half_b + std::sqrt(std::max(0.0, half_b * half_b - a * c)));
      mix(1.0 - t, t);
    }
  }

  void mix(double of_cauchy, double of_newton) {
    for (std::size_t i = 0; i < step_.size(); ++i) {
      step_[i] = of_cauchy * cauchy_[i] + of_newton * newton_[i];
    }
  }

  double initial_radius_;
  double radius_ = 0.0;
  std::vector<double> newton_, cauchy_, rhs_, product_, step_;
};

}  // namespace

std::unique_ptr<StepRule> make_dogleg(double initial_radius) {
  return std::make_unique<Dogleg>(initial_radius);
}

}  // namespace sidestep
