#pragma once

#include <sidestep/core/time.hpp>

#include "chain_model.hpp"
#include "step_rules.hpp"
#include "stopping_rules.hpp"

namespace sidestep {

/// Improves the model's current trajectory until an accepted step lowers the cost by no more than
/// a tolerance allows, no step lowers it, or a limit is met; the deadline within one step. The
/// best trajectory is the model's current one. [planning]; does not allocate.
[[nodiscard]] Minimisation minimise(ChainModel& model, StepRule& rule, const StoppingRules& stop,
                                    const Deadline& deadline);

}  // namespace sidestep
