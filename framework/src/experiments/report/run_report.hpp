#pragma once

#include <filesystem>
#include <string>

#include <sidestep/runtime/results_store.hpp>

#include "report/result_columns.hpp"

namespace sidestep::report {

/// How runs of one type of experiment are shown.
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
};

}  // namespace sidestep::report
