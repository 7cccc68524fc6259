#include "minimise.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "panel_kernels.hpp"
#include "stopping_rules.hpp"

namespace sidestep {
namespace {

class LevenbergMarquardt final : public StepRule {
 public:
  LevenbergMarquardt(double initial_damping, double relative_tolerance)
      : initial_damping_(initial_damping), relative_tolerance_(relative_tolerance) {}

  void reset(std::size_t variables) override {
    lambda_ = initial_damping_;
    step_.assign(variables, 0.0);
  }

  [[nodiscard]] StepOutcome iterate(ChainModel& model, const Deadline& deadline,
                                    int& tried) override {
    bool solved = false;
    double refused = std::numeric_limits<double>::infinity();  // length of the last refused step
    for (; lambda_ < kLargestDamping; lambda_ *= kDampingFactor) {
      if (!model.system().solve(lambda_, step_)) continue;
      solved = true;
      const double length = std::sqrt(dot(step_, step_));
      if (length > kSameLength * refused) continue;
      if (refused < std::numeric_limits<double>::infinity() && deadline.expired()) {
        return StepOutcome::kInterrupted;
      }
      ++tried;
      bool worth_more = true;
      if (try_step(model, worth_more)) {
        lambda_ = std::max(lambda_ / kDampingFactor, kLeastDampingShare * initial_damping_);
        return StepOutcome::kAccepted;
      }
      if (!worth_more) return StepOutcome::kNoBetter;
      refused = length;
    }
    return solved ? StepOutcome::kNoBetter : StepOutcome::kSingular;
  }

 private:
  /// Whether the step was accepted; clears `worth_more` if a larger lambda is not worth trying.
  [[nodiscard]] bool try_step(ChainModel& model, bool& worth_more) {
    const double predicted = model.system().predicted_decrease(lambda_, step_);
    if (!(predicted >= 0.0)) return false;
    const double before = model.current().cost;
    // A step that promises as little as the last one is going to be that.
    const bool is_last = predicted <= relative_tolerance_ * before;
    const double linearised_below = is_last ? -std::numeric_limits<double>::infinity() : before;
    const double decrease = before - model.try_step(step_, linearised_below);
    const bool beyond_rounding = predicted > std::numeric_limits<double>::epsilon() * before;
    if (beyond_rounding && decrease > kLeastFidelity * predicted) {
      model.accept();
      return true;
    }
    worth_more = !(std::abs(decrease) < relative_tolerance_ * before);
    return false;
  }

  double initial_damping_;
  double relative_tolerance_;
  double lambda_ = 0.0;
  std::vector<double> step_;
};

class GaussNewton final : public StepRule {
 public:
  void reset(std::size_t variables) override { step_.assign(variables, 0.0); }

  [[nodiscard]] StepOutcome iterate(ChainModel& model, const Deadline&, int& tried) override {
    ++tried;
    if (!model.system().solve(0.0, step_)) return StepOutcome::kSingular;
    const double before = model.current().cost;
    if (!(model.try_step(step_, before) < before)) return StepOutcome::kNoBetter;
    model.accept();
    return StepOutcome::kAccepted;
  }

 private:
  std::vector<double> step_;
};

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

std::unique_ptr<StepRule> make_levenberg_marquardt(double initial_damping,
                                                   double relative_tolerance) {
  return std::make_unique<LevenbergMarquardt>(initial_damping, relative_tolerance);
}

std::unique_ptr<StepRule> make_gauss_newton() { return std::make_unique<GaussNewton>(); }

std::unique_ptr<StepRule> make_dogleg(double initial_radius) {
  return std::make_unique<Dogleg>(initial_radius);
}

Minimisation minimise(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                      const Deadline& deadline) {
  using End = Minimisation::End;
  Minimisation result;
  const auto ended = [&result](End end) {
    result.end = end;
    return result;
  };
  rule.reset(model.current().support.size());
  while (result.accepted < stop.max_iterations) {
    if (deadline.expired()) return ended(End::kDeadline);
    const double before = model.current().cost;
    model.linearise();
    switch (rule.iterate(model, deadline, result.tried)) {
      case StepOutcome::kNoBetter: return ended(End::kConverged);
      case StepOutcome::kSingular: return ended(End::kSingular);
      case StepOutcome::kInterrupted: return ended(End::kDeadline);
      case StepOutcome::kAccepted: break;
    }
    ++result.accepted;
    result.last_decrease = before - model.current().cost;
    if (result.last_decrease <= stop.absolute_tolerance ||
        result.last_decrease <= stop.relative_tolerance * before) {
      return ended(End::kConverged);
    }
  }
  return ended(End::kIterationLimit);
}

Minimisation settle(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                    const Deadline& deadline, std::vector<double>& step) {
  using End = Minimisation::End;
  Minimisation result;
  const auto ended = [&result](End end) {
    result.end = end;
    return result;
  };
  step.resize(model.current().support.size());
  while (result.accepted < stop.max_iterations) {
    if (deadline.expired()) return ended(End::kDeadline);
    const double before = model.current().cost;
    const double enough = std::max(stop.absolute_tolerance, stop.relative_tolerance * before);
    model.linearise();
    if (!model.system().solve(0.0, step)) break;
    const double predicted = model.system().predicted_decrease(0.0, step);
    if (predicted <= enough) return ended(End::kConverged);
    ++result.tried;
    const double decrease = before - model.try_step(step);
    if (!(decrease > kLeastFidelity * predicted)) {
      // Too little changes for a shorter step to be worth trying: levenberg_marquardt's rule.
      if (std::abs(decrease) < stop.relative_tolerance * before) return ended(End::kConverged);
      break;
    }
    model.accept();
    ++result.accepted;
    result.last_decrease = decrease;
    if (decrease <= enough) return ended(End::kConverged);
  }
  StoppingRules rest = stop;
  rest.max_iterations -= result.accepted;
  const Minimisation damped = minimise(model, rule, rest, deadline);
  result.end = damped.end;
  result.accepted += damped.accepted;
  result.tried += damped.tried;
  if (damped.accepted > 0) result.last_decrease = damped.last_decrease;
  return result;
}

}  // namespace sidestep
