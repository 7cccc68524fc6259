#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/core/error.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/report/canvas.hpp>

namespace sidestep {

/// Text with what HTML would read as its own replaced.
[[nodiscard]] std::string escape_html(std::string_view text);
/// A whole page: title and body in the look of the reports, nothing fetched from anywhere.
[[nodiscard]] std::string html_page(std::string_view title, const std::string& body);

/// A table in columns of equal width for a terminal; the first column is flush left, the
/// others flush right.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) : rows_{std::move(header)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  [[nodiscard]] std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

namespace report {

using Json = nlohmann::ordered_json;
using Row = std::vector<std::string>;

/// The value at a JSON pointer, or null.
[[nodiscard]] Json at(const Json& json, const char* pointer);

/// The pattern of a share: 0.5 is "50.0 %".
inline constexpr const char* kPercent = "percent";

/// A cell: a number as `pattern` writes it, text as it is, a truth value as yes or no or as the
/// one or the other word of a pattern like "signed|unsigned"; "-" for nothing and for a number that
/// is not finite.
[[nodiscard]] std::string cell(const Json& value, const char* pattern = "%g");

/// A column of a table: its name, where its values stand in what makes a row, and their pattern.
struct Column {
  std::string name;
  const char* pointer;
  const char* pattern = "%g";
};
using Columns = std::vector<Column>;
[[nodiscard]] Row names_of(const Columns& columns);
[[nodiscard]] Row cells_of(const Json& json, const Columns& columns);

/// A table for a terminal, one row an element of `rows`.
[[nodiscard]] std::string text_table(const Columns& columns, const Json& rows);

[[nodiscard]] std::string html_table(const Row& header, const std::vector<Row>& rows);
[[nodiscard]] std::string html_table(const Columns& columns, const Json& rows);

/// Writes the pictures beside the report and returns them embedded.
[[nodiscard]] Result<std::string> figure_section(const std::vector<Figure>& figures,
                                                 const std::filesystem::path& run);

}  // namespace report
}  // namespace sidestep
