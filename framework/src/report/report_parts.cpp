#include <sidestep/report/report_parts.hpp>

#include <cmath>
#include <string_view>

#include <sidestep/report/html.hpp>
#include <sidestep/report/text_table.hpp>

namespace sidestep::report {

namespace fs = std::filesystem;

namespace {

/// Characters from which on a cell is broken into lines: numbers and names stay whole.
constexpr std::size_t kLongCell = 40;

}  // namespace

Json at(const Json& json, const char* pointer) {
  const Json::json_pointer where(pointer);
  return json.contains(where) ? json.at(where) : Json();
}

std::string cell(const Json& value, const char* pattern) {
  if (value.is_boolean()) {
    const std::string_view words(pattern);
    const std::size_t bar = words.find('|');
    if (bar == std::string_view::npos) return value.get<bool>() ? "yes" : "no";
    return std::string(value.get<bool>() ? words.substr(0, bar) : words.substr(bar + 1));
  }
  if (value.is_number()) {
    const double number = value.get<double>();
    if (!std::isfinite(number)) return "-";
    const bool is_share = std::string_view(pattern) == kPercent;
    return is_share ? format("%.1f %%", 100.0 * number) : format(pattern, number);
  }
  if (value.is_string()) return value.get<std::string>();
  return "-";
}

Row names_of(const Columns& columns) {
  Row row;
  for (const Column& column : columns) row.push_back(column.name);
  return row;
}

Row cells_of(const Json& json, const Columns& columns) {
  Row row;
  for (const Column& column : columns)
    row.push_back(cell(at(json, column.pointer), column.pattern));
  return row;
}

Json those_with(const char* pointer, const Json& elements) {
  Json those = Json::array();
  for (const Json& element : elements) {
    if (at(element, pointer).is_object()) those.push_back(element);
  }
  return those;
}

std::string text_table(const Columns& columns, const Json& rows) {
  TextTable table(names_of(columns));
  for (const Json& row : rows) table.add(cells_of(row, columns));
  return table.text();
}

std::string html_table(const Columns& columns, const Json& rows) {
  std::vector<Row> cells;
  for (const Json& row : rows) cells.push_back(cells_of(row, columns));
  return html_table(names_of(columns), cells);
}

std::string html_table(const Row& header, const std::vector<Row>& rows) {
  std::string html = "<div class=\"wide\"><table>\n<tr>";
  for (const std::string& name : header) html += "<th>" + escape_html(name) + "</th>";
  html += "</tr>\n";
  for (const Row& row : rows) {
    html += "<tr>";
    for (const std::string& value : row) {
      html += value.size() > kLongCell ? "<td class=\"long\">" : "<td>";
      html += escape_html(value) + "</td>";
    }
    html += "</tr>\n";
  }
  html += "</table></div>\n";
  return html;
}

Result<std::string> figure_section(const std::vector<Figure>& figures, const fs::path& run) {
  std::string html;
  for (const Figure& figure : figures) {
    const fs::path png = run / (figure.file + ".png");
    auto written = figure.canvas.write_png(png);
    if (written) written = figure.canvas.write_svg(run / (figure.file + ".svg"));
    if (!written) return error_of(written);
    const auto image = SIDESTEP_TRY(embedded_png(png));
    html += "<figure><img alt=\"" + escape_html(figure.caption) + "\" src=\"" + image +
            "\"><figcaption>" + escape_html(figure.caption) + "</figcaption></figure>\n";
  }
  return html;
}

}  // namespace sidestep::report
