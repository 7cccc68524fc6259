#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/statistics.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep::report {

inline constexpr const char* kWholeSummary = "summary.json";

/// Where a column stands besides summary.json and table.csv.
struct Shown {
  std::string heading;  ///< In tables; empty: in none.
  const char* pattern = "%g";
  bool compared = false;          ///< In the comparison of runs, too.
  bool page_only = false;         ///< Not on the terminal, which is narrower than a page.
  std::string_view statistics{};  ///< Those that tables show; empty: all.
  bool only_measured = false;     ///< A row without a value does not have the key.
};

struct ResultColumn {
  std::string pointer;  ///< Of its value in a row of summary.json.
  std::string meaning;
  Shown shown;
  std::size_t table = 0;  ///< 0: in each, at its begin.
};

/// A table of a report: its columns are those that name it.
struct ResultTable {
  std::string title;
  std::string note;  ///< HTML below it on a page.
};

/// The columns of the rows of a result, declared once. Rows of summary.json, table.csv, the tables
/// of terminal, page and comparison, and the reference page follow from it.
class ResultColumns {
 public:
  /// `pointer`: of the list of rows in summary.json; kWholeSummary where it is a row itself, empty
  /// where it has none such.
  explicit ResultColumns(std::string pointer) : pointer_(std::move(pointer)) {}

  [[nodiscard]] Json rows_of(const Json& summary) const {
    return pointer_ == kWholeSummary ? Json::array({summary}) : at(summary, pointer_.c_str());
  }
  [[nodiscard]] const std::vector<ResultColumn>& columns() const noexcept { return columns_; }

  [[nodiscard]] std::string csv(const Json& rows) const;
  /// A table after the other. Rows of which a table shows nothing but what each begins with are
  /// left out of it, and tables without rows.
  [[nodiscard]] std::string text(const Json& rows) const;
  [[nodiscard]] std::string html(const Json& rows) const;
  [[nodiscard]] Columns compared() const;
  /// Markdown: a table of keys and meanings.
  [[nodiscard]] std::string reference() const;

  /// A column of rows that are made elsewhere.
  void declare(const std::string& key, const std::string& meaning, const Shown& shown = {});
  void declare_statistics(const std::string& prefix, const std::string& meaning,
                          const std::vector<std::string>& statistics, const Shown& shown);
  /// Begins a table; columns before the first one stand in each, and in none where there is none.
  void begin_table(std::string title, std::string note = "") {
    tables_.push_back({std::move(title), std::move(note)});
  }

 private:
  [[nodiscard]] Columns shown_in(std::size_t table, bool on_page) const;
  [[nodiscard]] Json rows_in(std::size_t table, const Json& rows) const;

  std::string pointer_;
  std::vector<ResultColumn> columns_;
  std::vector<ResultTable> tables_;
};

/// The same, and how values come from what was measured.
template <class Row>
class ResultColumnsOf : public ResultColumns {
 public:
  using ResultColumns::ResultColumns;

  ResultColumnsOf& table(std::string title, std::string note = "") {
    begin_table(std::move(title), std::move(note));
    return *this;
  }
  /// A column: `value(row)` or a member of the row. `key` is its place in a row of summary.json,
  /// with dots between objects.
  template <class Value>
  ResultColumnsOf& add(const std::string& key, Value value, const std::string& meaning,
                       const Shown& shown = {}) {
    declare(key, meaning, shown);
    values_.push_back([value](const Row& row) { return Json(std::invoke(value, row)); });
    return *this;
  }
  /// Columns of statistics of `values(row)`, each null where there are none: of "p05", "p50",
  /// "median", "p95", "max", "mean" and "sd"; `prefix` and that is a column's key.
  template <class Values>
  ResultColumnsOf& spread(const std::string& prefix, Values values, const std::string& meaning,
                          const std::vector<std::string>& statistics, const Shown& shown = {}) {
    declare_statistics(prefix, meaning, statistics, shown);
    for (const std::string& name : statistics) {
      values_.push_back(
          [values, name](const Row& row) { return statistic(std::invoke(values, row), name); });
    }
    return *this;
  }

  /// One row as it stands in summary.json.
  [[nodiscard]] Json row(const Row& row) const {
    Json json = Json::object();
    for (std::size_t c = 0; c < values_.size(); ++c) {
      Json value = values_[c](row);
      if (value.is_null() && columns()[c].shown.only_measured) continue;
      json[Json::json_pointer(columns()[c].pointer)] = std::move(value);
    }
    return json;
  }

 private:
  [[nodiscard]] static Json statistic(const std::vector<double>& values, const std::string& name) {
    if (values.empty()) return nullptr;
    if (name == "mean") return statistics_of(values).mean;
    if (name == "sd") return statistics_of(values).sd;
    if (name == "median") return percentile(values, 0.5);
    return percentile(values, name == "max" ? 1.0 : std::stod("0." + name.substr(1)));
  }

  std::vector<std::function<Json(const Row&)>> values_;
};

/// How the runs of an experiment are shown.
struct RunReport {
  /// What stands between the verdict and the configuration. Draws its pictures into the run's
  /// folder.
  Result<std::string> (*body)(const Json& summary, ResultsReader& results,
                              const std::filesystem::path& run);
  /// The columns of the result's rows, where it has any: reference page and comparison of runs.
  const ResultColumns* columns = nullptr;
  /// Of the summary itself, beside them.
  Columns compared_of_run = {};
  /// The rows that a run adds to the comparison, where they are not those of the columns; their
  /// values hide those of the summary.
  Json (*compared_rows)(const Json& summary) = nullptr;
  /// Beginnings of the names of the pictures that it draws, e.g. "episode-", and the names of other
  /// files that its runs leave: an experiment that is run into the same folder removes them.
  std::vector<std::string> pictures = {};
  std::vector<std::string> files = {};

  /// Whether it leaves a file of this name.
  [[nodiscard]] bool writes(std::string_view name) const;
};

}  // namespace sidestep::report
