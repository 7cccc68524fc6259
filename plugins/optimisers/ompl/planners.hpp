#pragma once

#include <map>
#include <string>
#include <vector>

#include <ompl/base/Planner.h>

namespace sidestep::ompl_optimiser {

/// The geometric planners of the installed OMPL that can search a problem's joint space, by name.
[[nodiscard]] std::vector<std::string> planner_names();

/// A planner by its name, one of planner_names(). Allocates.
[[nodiscard]] ::ompl::base::PlannerPtr make_planner(
    const ::ompl::base::SpaceInformationPtr& information, const std::string& name);

/// The parameters that a planner declares, with the values they have if nothing is said.
[[nodiscard]] std::map<std::string, std::string> parameters_of(const std::string& name);

/// Sets a planner's parameter, written as in a configuration (`true` and `false`, numbers, words).
/// What is wrong with it, in words that go on after the parameter's name; empty if nothing is.
[[nodiscard]] std::string set_parameter(::ompl::base::Planner& planner, const std::string& name,
                                        const std::string& value);

/// set_parameter() on a planner of its own, which searches nothing.
[[nodiscard]] std::string try_parameter(const std::string& planner, const std::string& name,
                                        const std::string& value);

}  // namespace sidestep::ompl_optimiser
