#pragma once

#include <cstdint>
#include <mutex>
#include <string>

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

}  // namespace sidestep::ompl_optimiser
