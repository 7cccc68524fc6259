#include <sidestep/report/csv.hpp>

#include <algorithm>
#include <cmath>

#include <sidestep/report/report_parts.hpp>

namespace sidestep {

std::string csv_cell(const nlohmann::ordered_json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) return "";
  if (value.is_null()) return "";
  if (!value.is_string()) return value.dump();
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string csv_text(const nlohmann::ordered_json& rows, std::span<const char* const> columns) {
  std::string text;
  for (const char* column : columns) {
    std::string name = column + 1;
    std::ranges::replace(name, '/', '.');
    text += (text.empty() ? "" : ",") + name;
  }
  text += "\n";
  for (const auto& row : rows) {
    std::string line;
    for (const char* column : columns) {
      line += (column == columns.front() ? "" : ",") + csv_cell(report::at(row, column));
    }
    text += line + "\n";
  }
  return text;
}

}  // namespace sidestep
