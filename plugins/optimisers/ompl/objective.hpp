#pragma once

#include <memory>

#include <ompl/base/OptimizationObjective.h>

#include <sidestep/planning/problem.hpp>

#include "options.hpp"
#include "search.hpp"

namespace sidestep::ompl_optimiser {

/// What the options ask planners to minimise, in seconds at full speed: the length of the path, or
/// the integral along it of
///
///     share + weight * max(0, 1 - clearance / clearance_m)^2
///
/// with share 1 for `length_and_clearance`; for `clearance` it is so small that it decides only
/// between paths that are equally clear. Clearance is that of the sphere nearest to an obstacle or
/// the floor. `problem` and `search` must outlive it.
[[nodiscard]] ::ompl::base::OptimizationObjectivePtr make_objective(
    const ::ompl::base::SpaceInformationPtr& information, const Options& options,
    const Problem& problem, const Search& search);

}  // namespace sidestep::ompl_optimiser
