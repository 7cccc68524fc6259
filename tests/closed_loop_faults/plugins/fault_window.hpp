#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::faulty {

/// What a plugin that wraps a real one does wrong, and when, on the run's clock.
struct FaultOptions {
  std::string fault = "none";
  double from_s = 0.0;
  double until_s = 1e9;
};

/// Declares them; an executor, say, adds those of what it wraps.
template <class Options>
Parameters<Options> declare_fault(const std::vector<std::string>& faults) {
  std::vector<std::string> choices = faults;
  choices.emplace_back("none");
  return Parameters<Options>()
      .add("fault", &Options::fault, "What goes wrong.", {.choices = choices})
      .add("from_s", &Options::from_s, "Since when.", {.unit = "s"})
      .add("until_s", &Options::until_s, "Until when.", {.unit = "s"});
}

/// Whether a fault is there now. [any]
class FaultWindow {
 public:
  FaultWindow(const FaultOptions& options, const Clock& clock) : options_(options), clock_(clock) {}

  [[nodiscard]] bool has(std::string_view fault) const {
    return options_.fault == fault && is_open();
  }
  [[nodiscard]] bool is_open() const {
    const double now_s = clock_.now().seconds();
    return now_s >= options_.from_s && now_s < options_.until_s;
  }
  void pass(std::string_view fault) const {
    if (has(fault)) throw std::runtime_error("is on fire");
  }
  /// Until the fault is over, whatever that takes.
  void hang() const {
    while (is_open()) std::this_thread::yield();
  }

 private:
  FaultOptions options_;
  const Clock& clock_;
};

}  // namespace sidestep::faulty
