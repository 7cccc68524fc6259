#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include <ompl/base/Planner.h>
#include <ompl/util/Console.h>

#include <sidestep/core/log.hpp>

namespace sidestep::ompl_optimiser {

/// Exclusive use of OMPL's process-wide random seed and output for as long as it lives: solves
/// run one after another, each from its own seed. What OMPL has to say goes to `log`, its
/// information as debugging.
class Session final : private ::ompl::msg::OutputHandler {
 public:
  Session(std::uint64_t seed, Log& log);
  ~Session() override;
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

 private:
  void log(const std::string& text, ::ompl::msg::LogLevel level, const char* file,
           int line) override;

  std::lock_guard<std::mutex> lock_;
  Log& log_;
  ::ompl::msg::OutputHandler* previous_;
};

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
