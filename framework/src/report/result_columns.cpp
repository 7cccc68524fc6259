#include <sidestep/report/result_columns.hpp>

#include <algorithm>
#include <cmath>

namespace sidestep::report {
namespace {

/// A cell of a CSV file, quoted where it must be; empty for null and for numbers that are
/// not finite.
std::string csv_cell(const Json& value) {
  if (value.is_number_float() && !std::isfinite(value.get<double>())) return "";
  if (value.is_null()) return "";
  if (!value.is_string()) return value.dump();
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// A pointer's way with dots for slashes.
std::string key_of(const ResultColumn& column) {
  std::string key = column.pointer.substr(1);
  std::ranges::replace(key, '/', '.');
  return key;
}

}  // namespace

void ResultColumns::declare(const std::string& key, const std::string& meaning,
                            const Shown& shown) {
  std::string pointer = "/" + key;
  std::ranges::replace(pointer, '.', '/');
  columns_.push_back({std::move(pointer), meaning, shown, tables_.size()});
}

void ResultColumns::declare_statistics(const std::string& prefix, const std::string& meaning,
                                       const std::vector<std::string>& statistics,
                                       const Shown& shown) {
  for (const std::string& name : statistics) {
    const bool is_shown =
        !shown.heading.empty() &&
        (shown.statistics.empty() || shown.statistics.find(name) != shown.statistics.npos);
    Shown one = shown;
    one.heading = is_shown ? shown.heading + " " + name : "";
    declare(prefix + name, meaning, one);
  }
}

std::string ResultColumns::csv(const Json& rows) const {
  std::string text;
  for (const ResultColumn& column : columns_) text += (text.empty() ? "" : ",") + key_of(column);
  text += "\n";
  for (const Json& row : rows) {
    std::string line;
    for (const ResultColumn& column : columns_) {
      line += (&column == &columns_.front() ? "" : ",") + csv_cell(at(row, column.pointer.c_str()));
    }
    text += line + "\n";
  }
  return text;
}

Columns ResultColumns::shown_in(std::size_t table, bool on_page) const {
  Columns shown;
  for (const ResultColumn& column : columns_) {
    const bool is_here = column.table == 0 || column.table == table;
    if (!is_here || column.shown.heading.empty() || (column.shown.page_only && !on_page)) continue;
    shown.push_back({column.shown.heading, column.pointer.c_str(), column.shown.pattern});
  }
  return shown;
}

Json ResultColumns::rows_in(std::size_t table, const Json& rows) const {
  Json those = Json::array();
  for (const Json& row : rows) {
    const auto is_filled = [&](const ResultColumn& column) {
      return column.table == table && !at(row, column.pointer.c_str()).is_null();
    };
    if (std::ranges::any_of(columns_, is_filled)) those.push_back(row);
  }
  return those;
}

std::string ResultColumns::text(const Json& rows) const {
  std::string text;
  for (std::size_t t = 1; t <= tables_.size(); ++t) {
    const Json those = rows_in(t, rows);
    if (those.empty()) continue;
    text += (text.empty() ? "" : "\n") + text_table(shown_in(t, false), those);
  }
  return text;
}

std::string ResultColumns::html(const Json& rows) const {
  std::string html;
  for (std::size_t t = 1; t <= tables_.size(); ++t) {
    const Json those = rows_in(t, rows);
    if (those.empty()) continue;
    html += "<h2>" + escape_html(tables_[t - 1].title) + "</h2>\n" +
            html_table(shown_in(t, true), those);
    if (!tables_[t - 1].note.empty()) html += "<p>" + tables_[t - 1].note + "</p>\n";
  }
  return html;
}

Columns ResultColumns::compared() const {
  Columns compared;
  for (const ResultColumn& column : columns_) {
    if (!column.shown.compared || column.shown.heading.empty()) continue;
    compared.push_back({column.shown.heading, column.pointer.c_str(), column.shown.pattern});
  }
  return compared;
}

std::string ResultColumns::reference() const {
  const std::string of = pointer_.empty()            ? "column of `table.csv`"
                         : pointer_ == kWholeSummary ? "key of `" + pointer_ + "`"
                                                     : "key of `" + pointer_.substr(1) + "`";
  std::string text = "| " + of + " | meaning |\n| --- | --- |\n";
  for (const ResultColumn& column : columns_) {
    text += "| `" + key_of(column) + "` | " + column.meaning + " |\n";
  }
  return text;
}

bool RunReport::writes(std::string_view name) const {
  if (std::ranges::find(files, name) != files.end()) return true;
  return (name.ends_with(".png") || name.ends_with(".svg")) &&
         std::ranges::any_of(pictures,
                             [&](const std::string& begin) { return name.starts_with(begin); });
}

}  // namespace sidestep::report
