#pragma once

#include <memory>
#include <vector>

#include <sidestep/core/time.hpp>

#include "chain_model.hpp"
#include "stopping_rules.hpp"

namespace sidestep {

/// How an iteration ended.
enum class StepOutcome {
  kAccepted,     ///< The trajectory has changed.
  kNoBetter,     ///< No step that was tried lowers the cost enough to be worth it.
  kSingular,     ///< The normal equations could not be solved.
  kInterrupted,  ///< The deadline passed before a step was accepted.
};

/// Chooses the steps of a minimisation from a linearised model, one iteration after the other.
class StepRule {
 public:
  virtual ~StepRule() = default;

  /// Forgets what earlier solves have taught. `variables`: of the whole chain.
  virtual void reset(std::size_t variables) = 0;

  /// Tries steps until one is accepted or none is worth it. Every step tried adds one to `tried`.
  [[nodiscard]] virtual StepOutcome iterate(ChainModel& model, const Deadline& deadline,
                                            int& tried) = 0;
};

/// Levenberg-Marquardt as GPMP2 runs it (GTSAM's): (H + lambda I) step = -gradient, lambda divided
/// by ten after an accepted step and times ten after a rejected one, which re-uses H. One that is
/// hardly shorter than the one just refused is not tried. A step is accepted if it achieves more
/// than a thousandth of the decrease that the model predicts. None is better if lambda reaches 1e5,
/// or if a rejected step changes the cost by less than `relative_tolerance` of it.
[[nodiscard]] std::unique_ptr<StepRule> make_levenberg_marquardt(double initial_damping,
                                                                 double relative_tolerance);

/// The full Gauss-Newton step, accepted if it lowers the cost.
[[nodiscard]] std::unique_ptr<StepRule> make_gauss_newton();

/// Powell's dogleg: the Gauss-Newton step cut to a trust region along the path over the steepest
/// descent's minimum (Nocedal and Wright, Numerical Optimization, 2nd ed., algorithm 4.1).
/// `initial_radius`: of the trust region, in the units of the states.
[[nodiscard]] std::unique_ptr<StepRule> make_dogleg(double initial_radius);

/// Improves the model's current trajectory until an accepted step lowers the cost by no more than
/// a tolerance allows, no step lowers it, or a limit is met; the deadline within one step. The
/// best trajectory is the model's current one. [planning]; does not allocate.
[[nodiscard]] Minimisation minimise(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                                    const Deadline& deadline);

/// Improves a trajectory that was at its minimum before something changed: by full Gauss-Newton
/// steps, until an accepted step lowers the cost by no more than a tolerance allows, or the next
/// one would, by what the normal equations predict. That last step is not taken, so that the
/// elimination is that of the trajectory found. At the first step that achieves less than a
/// thousandth of what it promises it hands over to minimise(), or ends where the step changes the
/// cost by less than `relative_tolerance` of it. `step`: room for one. [planning]; allocates
/// only in step, where that was never as large.
[[nodiscard]] Minimisation settle(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                                  const Deadline& deadline, std::vector<double>& step);

}  // namespace sidestep
