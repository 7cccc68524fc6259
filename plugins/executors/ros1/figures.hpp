#pragma once

#include <cstdio>
#include <string>

namespace sidestep::ros1_executor {

/// A number for people, to four digits.
[[nodiscard]] inline std::string figure(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

}  // namespace sidestep::ros1_executor
