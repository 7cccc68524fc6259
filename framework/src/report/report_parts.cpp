#include <sidestep/report/report_parts.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <sidestep/core/file.hpp>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// Characters from which on a cell is broken into lines: numbers and names stay whole.
constexpr std::size_t kLongCell = 40;

constexpr std::string_view kStyle = R"(
  body { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #222; background: #fff;
         max-width: 960px; margin: 2em auto; padding: 0 1em; }
  h1 { font-size: 1.5em; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #ddd; }
  .verdict { padding: .8em 1em; border-left: 6px solid; font-size: 1.1em; }
  .success { border-color: #0072B2; background: #eaf4fa; }
  .failure { border-color: #D55E00; background: #fdf0e6; }
  table { border-collapse: collapse; margin: 1em 0; }
  .wide { overflow-x: auto; width: min-content; min-width: 100%; max-width: calc(100vw - 3em);
          position: relative; left: 50%; transform: translateX(-50%); }
  .wide td { white-space: nowrap; } .wide td.long { white-space: normal; }
  th, td { padding: .3em .8em; text-align: right; border-bottom: 1px solid #ddd;
           vertical-align: top; }
  th:first-child, td:first-child, td.text { text-align: left; }
  th { background: #f5f5f5; }
  figure { margin: 1.5em 0; } figure img { width: 100%; max-width: 900px; }
  figcaption { color: #555; }
  pre { background: #f7f7f7; padding: 1em; overflow-x: auto; font-size: 13px; }
)";

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      word <<= 8;
      if (i + k < bytes.size()) word |= static_cast<unsigned char>(bytes[i + k]);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k <= bytes.size() ? kDigits[word >> (18 - 6 * k) & 63u] : '=';
    }
  }
  return text;
}

/// Characters, not bytes, of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(
      text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u; }));
}

}  // namespace

std::string escape_html(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&': safe += "&amp;"; break;
      case '<': safe += "&lt;"; break;
      case '>': safe += "&gt;"; break;
      case '"': safe += "&quot;"; break;
      default: safe += c;
    }
  }
  return safe;
}

std::string html_page(std::string_view title, const std::string& body) {
  return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         "<meta name=\"viewport\" content=\"width=device-width\">\n<title>" +
         escape_html(title) + "</title>\n<style>" + std::string(kStyle) +
         "</style>\n</head>\n<body>\n" + body + "</body>\n</html>\n";
}

std::string TextTable::text() const {
  std::vector<std::size_t> widths(rows_.front().size(), 0);
  for (const auto& row : rows_) {
    for (std::size_t c = 0; c < widths.size() && c < row.size(); ++c) {
      widths[c] = std::max(widths[c], width_of(row[c]));
    }
  }
  std::string text;
  const auto add_row = [&](const std::vector<std::string>& row) {
    for (std::size_t c = 0; c < widths.size(); ++c) {
      const std::string cell = c < row.size() ? row[c] : "";
      const std::string space(widths[c] - width_of(cell), ' ');
      text += (c == 0 ? cell + space : "  " + space + cell);
    }
    text.erase(text.find_last_not_of(' ') + 1);
    text += '\n';
  };
  add_row(rows_.front());
  text += std::string(std::accumulate(widths.begin(), widths.end(), 2 * (widths.size() - 1)), '-');
  text += '\n';
  for (std::size_t r = 1; r < rows_.size(); ++r) add_row(rows_[r]);
  return text;
}

namespace report {

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
    const auto image = base64(SIDESTEP_TRY(read_file(png)));
    html += "<figure><img alt=\"" + escape_html(figure.caption) +
            "\" src=\"data:image/png;base64," + image + "\"><figcaption>" +
            escape_html(figure.caption) + "</figcaption></figure>\n";
  }
  return html;
}

}  // namespace report
}  // namespace sidestep
