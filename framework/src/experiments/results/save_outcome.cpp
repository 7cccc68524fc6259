#include "results/save_outcome.hpp"

#include <sidestep/experiments/report.hpp>

#include "report/html.hpp"

namespace sidestep {

Result<void> save_outcome(const ExperimentOutcome& outcome, const std::filesystem::path& run) {
  auto saved = write_file(run / "summary.json", outcome.summary_json);
  if (saved && !outcome.table_csv.empty()) {
    saved = write_file(run / "table.csv", outcome.table_csv);
  }
  return saved ? write_report(run) : saved;
}

}  // namespace sidestep
