#include "report_parts.hpp"

#include "html.hpp"
#include "text_table.hpp"

namespace sidestep::report {

namespace fs = std::filesystem;

Json at(const Json& json, const char* pointer) {
  const Json::json_pointer where(pointer);
  return json.contains(where) ? json.at(where) : Json();
}

std::string cell(const Json& value, const char* pattern) {
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (value.is_number()) return format(pattern, value.get<double>());
  if (value.is_string()) return value.get<std::string>();
  return "-";
}

std::string html_table(const Row& header, const std::vector<Row>& rows) {
  std::string html = "<div class=\"wide\"><table>\n<tr>";
  for (const std::string& name : header) html += "<th>" + escape_html(name) + "</th>";
  html += "</tr>\n";
  for (const Row& row : rows) {
    html += "<tr>";
    for (const std::string& value : row) html += "<td>" + escape_html(value) + "</td>";
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
    if (!written) return tl::make_unexpected(std::move(written.error()));
    const auto image = embedded_png(png);
    if (!image) return tl::make_unexpected(image.error());
    html += "<figure><img alt=\"" + escape_html(figure.caption) + "\" src=\"" + *image +
            "\"><figcaption>" + escape_html(figure.caption) + "</figcaption></figure>\n";
  }
  return html;
}

}  // namespace sidestep::report
