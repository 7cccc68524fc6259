#pragma once

#include <string>

#include <nlohmann/json.hpp>

namespace sidestep {

/// As it stands in summary.json: indented, a newline at the end, numbers that are not finite as
/// null, bytes that are not UTF-8 replaced.
[[nodiscard]] inline std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace sidestep
