#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "figures.hpp"

namespace sidestep::report {

using Json = nlohmann::ordered_json;
using Row = std::vector<std::string>;

/// The value at a JSON pointer, or null.
[[nodiscard]] Json at(const Json& json, const char* pointer);

/// A cell: a number as `pattern` writes it, text as it is, "-" for nothing.
[[nodiscard]] std::string cell(const Json& value, const char* pattern = "%g");

[[nodiscard]] std::string html_table(const Row& header, const std::vector<Row>& rows);

/// Writes the pictures beside the report and returns them embedded.
[[nodiscard]] Result<std::string> figure_section(const std::vector<Figure>& figures,
                                                 const std::filesystem::path& run);

/// Tables and chart of a mapping benchmark.
[[nodiscard]] Result<std::string> mapping_body(const Json& summary,
                                               const std::filesystem::path& run);

/// Tables and charts of a planner benchmark.
[[nodiscard]] Result<std::string> planner_body(const Json& summary, ResultsReader& results,
                                               const std::filesystem::path& run);

/// The table of a replanning experiment.
[[nodiscard]] std::string replanning_body(const Json& summary);

/// Tables and pictures of a closed loop.
[[nodiscard]] Result<std::string> replan_body(const Json& summary, ResultsReader& results,
                                              const std::filesystem::path& run);

/// Tables and pictures of a field study.
[[nodiscard]] Result<std::string> study_body(const Json& summary, const std::filesystem::path& run);

}  // namespace sidestep::report
