#pragma once

#include <filesystem>
#include <string>

#include <sidestep/runtime/results_store.hpp>

#include "report/report_parts.hpp"

namespace sidestep::report {

/// How runs of one type of experiment are shown.
struct RunReport {
  /// What stands between the verdict and the configuration. Draws its pictures into the run's
  /// folder.
  Result<std::string> (*body)(const Json& summary, ResultsReader& results,
                              const std::filesystem::path& run);
  /// Columns in which several runs are compared, between their names and commits; none where runs
  /// are not compared.
  Columns compared = {};
  /// The rows that a run adds to the comparison; their values hide those of the summary.
  Json (*compared_items)(const Json& summary) = nullptr;
};

}  // namespace sidestep::report
