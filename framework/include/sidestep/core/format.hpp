#pragma once

#include <cstdio>
#include <string>

namespace sidestep {

/// Numbers in words, as printf writes them: format("%.2f s", 1.5). At most 127 characters. [any]
template <class... Numbers>
[[nodiscard]] std::string format(const char* pattern, Numbers... numbers) {
  char text[128];
  std::snprintf(text, sizeof text, pattern, numbers...);
  return text;
}

}  // namespace sidestep
