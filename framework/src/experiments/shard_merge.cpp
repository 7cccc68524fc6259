#include <algorithm>

#include <sidestep/experiments/report.hpp>
#include <sidestep/report/report_parts.hpp>
#include <sidestep/results/text_file.hpp>

#include "find_experiment.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using report::Json;

/// summary.json of a run; null where there is none.
Json summary_of(const fs::path& run) {
  const auto text = read_file(run / "summary.json");
  Json summary = text ? Json::parse(*text, nullptr, false) : Json();
  return summary.is_object() ? summary : Json();
}

}  // namespace

bool are_shards(const std::vector<fs::path>& runs) {
  return !runs.empty() && std::ranges::all_of(runs, [](const fs::path& run) {
    const Json summary = summary_of(run);
    return summary.contains("shard") && summary["shard"].is_object();
  });
}

Result<ExperimentOutcome> merge_shards(const std::vector<fs::path>& runs, const fs::path& out,
                                       Host& host) {
  std::error_code error;
  for (const fs::path& run : runs) {
    if (!fs::equivalent(run, out, error)) continue;
    return fail(ErrorCode::kConfig, "the folder holds one of the shards", out.string(),
                "give another one with --merged");
  }
  const std::string name = summary_of(runs.front()).value("experiment", "");
  const auto found = SIDESTEP_TRY(find_experiment(name, runs.front().string(), host));
  auto outcome = SIDESTEP_TRY(found.experiment->merge(runs, out));
  Result<void> written;
  if (const auto configuration = read_file(runs.front() / "effective_config.yaml")) {
    written = write_file(out / "effective_config.yaml", *configuration);
  }
  if (written) written = save_outcome(outcome, out, host);
  if (!written) return error_of(written);
  return outcome;
}

}  // namespace sidestep
