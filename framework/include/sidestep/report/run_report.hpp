#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep::report {

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
