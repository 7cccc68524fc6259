#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep::fake_hsr {

/// A part of the robot that falls silent for a while, in seconds since the first command.
struct Silence {
  std::string part;  ///< One of kParts.
  double from_s = 0.0;
  double until_s = 0.0;  ///< Infinity: for good.
};

/// Those that can.
[[nodiscard]] const std::vector<std::string>& parts();

/// `PART@FROM` or `PART@FROM+FOR`, e.g. `camera@5+3`. Fails with kInvalidArgument.
[[nodiscard]] Result<Silence> parse_silence(const std::string& text);

[[nodiscard]] bool is_silent(const std::vector<Silence>& silences, const std::string& part,
                             std::optional<double> since_command_s);

}  // namespace sidestep::fake_hsr
