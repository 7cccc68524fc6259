#pragma once

#include <span>
#include <string>

#include <nlohmann/json.hpp>

namespace sidestep {

/// A cell of a CSV file, quoted where it must be; empty for null and for numbers that are
/// not finite.
[[nodiscard]] std::string csv_cell(const nlohmann::ordered_json& value);

/// A table for a spreadsheet: one line a row, and of each row what stands at these JSON pointers,
/// whose names with dots for slashes make the first line.
[[nodiscard]] std::string csv_text(const nlohmann::ordered_json& rows,
                                   std::span<const char* const> columns);

}  // namespace sidestep
