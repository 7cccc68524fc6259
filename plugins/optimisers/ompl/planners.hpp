#pragma once

#include <string>

#include <ompl/base/Planner.h>

namespace sidestep::ompl_optimiser {

/// A planner by its name (one of Options::planner's choices); `range` as OMPL means it, 0 for
/// its own choice.
[[nodiscard]] ::ompl::base::PlannerPtr make_planner(
    const ::ompl::base::SpaceInformationPtr& information, const std::string& name, double range);

/// True for planners that go on improving a path until they are stopped.
[[nodiscard]] bool improves_until_stopped(const std::string& name);

}  // namespace sidestep::ompl_optimiser
