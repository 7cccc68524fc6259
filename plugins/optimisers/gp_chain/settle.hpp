#pragma once

#include <vector>

#include "minimise.hpp"

namespace sidestep {

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
