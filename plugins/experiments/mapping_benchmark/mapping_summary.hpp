#pragma once

#include <span>
#include <string>

#include <sidestep/report/result_columns.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>
#include "mapping_measure.hpp"

namespace sidestep {

/// Result of a mapping benchmark.
struct MappingBenchmarkRecord {
  std::vector<CaseRecord> cases;
  std::size_t planned_cases = 0;
  std::vector<Error> bad_frames;  ///< Of the source.
  bool has_truth = false;
  bool interrupted = false;
};

/// Verdict, summary.json and tables of a finished (or interrupted) mapping benchmark.
[[nodiscard]] ExperimentOutcome summarise_mapping(const RunProvenance& provenance,
                                                  const MappingBenchmarkSettings& settings,
                                                  const MappingBenchmarkRecord& record);

/// Why a case does not reach what the settings expect; empty where it does.
[[nodiscard]] std::string unmet_expectations(const CaseRecord& record,
                                             const ExpectSettings& expect);

/// Of the rows `systems` of summary.json.
[[nodiscard]] const report::ResultColumns& mapping_columns();

/// How such runs are shown.
[[nodiscard]] const report::RunReport& mapping_report();

}  // namespace sidestep
