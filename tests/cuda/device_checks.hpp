#pragma once

#include <functional>
#include <string>
#include <vector>

namespace sidestep::cuda_checks {

/// Something that must hold on a device: returns what is wrong, or nothing.
struct Check {
  std::string name;
  std::function<std::string()> run;
};

/// All of them, for this device.
[[nodiscard]] std::vector<Check> device_checks(int ordinal);

/// Those of batches of trajectories.
[[nodiscard]] std::vector<Check> chain_checks(int ordinal);

/// Why the device cannot be used, or nothing.
[[nodiscard]] std::string why_unusable(int ordinal);

/// Measures the stages of what the device does, and prints a table.
void print_times(int ordinal);

/// The same of batches of trajectories.
void print_chain_times(int ordinal);

}  // namespace sidestep::cuda_checks
