#include <algorithm>
#include <cmath>
#include <limits>

#include "damping.hpp"
#include "panel_kernels.hpp"
#include "step_rules.hpp"

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

}  // namespace

std::unique_ptr<StepRule> make_levenberg_marquardt(double initial_damping,
                                                   double relative_tolerance) {
  return std::make_unique<LevenbergMarquardt>(initial_damping, relative_tolerance);
}

}  // namespace sidestep
