#pragma once

#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// As it stands in summary.json: indented, a newline at the end, numbers that are not finite as
/// null, bytes that are not UTF-8 replaced.
[[nodiscard]] inline std::string json_text(const nlohmann::ordered_json& json) {
  return json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

/// `provenance` of a summary.
[[nodiscard]] inline nlohmann::ordered_json provenance_json(const RunProvenance& provenance) {
  return {{"version", provenance.version},         {"git_hash", provenance.git_hash},
          {"build_flags", provenance.build_flags}, {"cpu", provenance.cpu},
          {"threads", provenance.threads},         {"seed", provenance.seed}};
}

/// What summary.json holds: of what type the run was and how it ended, what is particular to the
/// type, and the provenance.
[[nodiscard]] inline std::string summary_text(const RunProvenance& provenance,
                                              std::string_view experiment,
                                              const ExperimentOutcome& outcome,
                                              const nlohmann::ordered_json& particulars) {
  nlohmann::ordered_json summary = {{"configuration", provenance.configuration},
                                    {"experiment", experiment},
                                    {"success", outcome.success},
                                    {"interrupted", outcome.interrupted},
                                    {"verdict", outcome.verdict}};
  summary.update(particulars);
  summary["provenance"] = provenance_json(provenance);
  return json_text(summary);
}

}  // namespace sidestep
