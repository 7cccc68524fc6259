#pragma once

#include <algorithm>
#include <functional>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/results/statistics.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// The provenance of this build on this machine, and of a run.
[[nodiscard]] inline RunProvenance provenance_of(const ExperimentContext& context) {
  RunProvenance provenance = current_provenance();
  provenance.configuration = context.configuration.name;
  provenance.seed = context.seed;
  provenance.threads = context.threads;
  return provenance;
}

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

/// How much one solve's cost may exceed another's and still count as no worse.
inline constexpr double kOnePercent = 1.01;

/// A number of every item: a member, or a function of it.
template <class Item, class Value>
[[nodiscard]] std::vector<double> values_of(const std::vector<Item>& items, Value value) {
  std::vector<double> values;
  for (const Item& item : items) values.push_back(static_cast<double>(std::invoke(value, item)));
  return values;
}

template <class Item, class Holds>
[[nodiscard]] std::vector<Item> those_of(const std::vector<Item>& items, Holds holds) {
  std::vector<Item> those;
  std::ranges::copy_if(items, std::back_inserter(those), holds);
  return those;
}

/// Of how large a share of the items something holds; null for no items.
template <class Item, class Holds>
[[nodiscard]] nlohmann::ordered_json share_of(const std::vector<Item>& items, Holds holds) {
  if (items.empty()) return nullptr;
  return static_cast<double>(std::ranges::count_if(items, holds)) /
         static_cast<double>(items.size());
}

[[nodiscard]] inline nlohmann::ordered_json quantile_json(const std::vector<double>& values,
                                                          double share) {
  if (values.empty()) return nullptr;
  return percentile(values, share);
}

}  // namespace sidestep
