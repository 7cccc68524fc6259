#include "mapping/mapping_summary.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <nlohmann/json.hpp>

#include "report/csv.hpp"
#include "report/report_parts.hpp"
#include "report/text_table.hpp"
#include "results/json.hpp"
#include "results/statistics.hpp"

namespace sidestep {
namespace {

using report::at;
using Json = nlohmann::ordered_json;

std::vector<double> values_of(const ClockRecord& clock, double (*value)(const UpdateRecord&)) {
  std::vector<double> values;
  for (const UpdateRecord& update : clock.updates) values.push_back(value(update));
  return values;
}

std::vector<double> frame_times(const ClockRecord& clock) {
  return values_of(clock, [](const UpdateRecord& update) { return update.frame_ms(); });
}

Json statistics_json(const std::vector<double>& values) {
  const Statistics s = statistics_of(values);
  return {{"mean", s.mean}, {"sd", s.sd}, {"p50", s.p50}, {"p95", s.p95}, {"max", s.max}};
}

Json stages_json(const ClockRecord& clock) {
  return {{"integrate",
           statistics_json(values_of(clock, [](const UpdateRecord& u) { return u.integrate_ms; }))},
          {"field",
           statistics_json(values_of(clock, [](const UpdateRecord& u) { return u.field_ms; }))},
          {"publish",
           statistics_json(values_of(clock, [](const UpdateRecord& u) { return u.publish_ms; }))}};
}

/// Time and memory in each quarter of the run: whether they grow.
Json quarters_json(const ClockRecord& clock) {
  Json quarters = Json::array();
  const std::size_t count = clock.updates.size();
  for (std::size_t q = 0; q < 4 && count >= 4; ++q) {
    const std::size_t begin = q * count / 4;
    const std::size_t end = (q + 1) * count / 4;
    std::vector<double> frame_ms;
    double memory_mib = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      frame_ms.push_back(clock.updates[i].frame_ms());
      memory_mib = std::max(memory_mib, clock.updates[i].resident_mib);
    }
    quarters.push_back({{"frames", end - begin},
                        {"frame_ms", statistics_json(frame_ms)},
                        {"memory_mib", memory_mib}});
  }
  return quarters;
}

Json truth_json(const TruthRecord& truth) {
  const auto recall = truth.collision_recall();
  Json json = {{"collision_recall", recall ? Json(*recall) : Json(nullptr)},
               {"surface_vox", truth.surface_vox},
               {"occupied_vox", truth.occupied_vox},
               {"false_obstacle_vox", truth.false_vox},
               {"appear_frames", nullptr},
               {"never_appeared", truth.never_appeared},
               {"gone_frames", nullptr},
               {"ghost_vox", truth.ghost_vox},
               {"ghost_seen_vox", truth.ghost_seen_vox}};
  if (!truth.appear_frames.empty()) {
    json["appear_frames"] = statistics_json(truth.appear_frames);
    json["appear_frames"]["events"] = truth.appear_frames.size();
  }
  if (!truth.gone_frames.empty()) {
    json["gone_frames"] = statistics_json(truth.gone_frames);
    json["gone_frames"]["voxels"] = truth.gone_frames.size();
  }
  return json;
}

Json real_time_json(const ClockRecord& clock) {
  const auto updates = static_cast<double>(clock.updates.size());
  const double arrived = updates + static_cast<double>(clock.dropped + clock.bad_frames);
  return {{"frames", clock.updates.size()},
          {"dropped", clock.dropped},
          {"dropped_share", arrived > 0.0 ? static_cast<double>(clock.dropped) / arrived : 0.0},
          {"rate_hz", clock.duration_s > 0.0 ? (updates - 1.0) / clock.duration_s : 0.0},
          {"frame_ms", statistics_json(frame_times(clock))},
          {"latency_ms",
           statistics_json(values_of(clock, [](const UpdateRecord& u) { return u.latency_ms; }))}};
}

const CaseRecord* reference_of(const CaseRecord& record, const MappingBenchmarkSettings& settings,
                               std::span<const CaseRecord> cases) {
  for (const CaseRecord& other : cases) {
    if (other.what.name == settings.reference && other.is_signed == record.is_signed &&
        std::abs(other.what.resolution_m - record.what.resolution_m) < kSameResolution) {
      return &other;
    }
  }
  return nullptr;
}

const ClockRecord* timed(const CaseRecord& record) {
  if (record.every_frame) return &*record.every_frame;
  return record.real_time ? &*record.real_time : nullptr;
}

/// How many times the reference's time an update takes; null where there is nothing to compare.
Json ratio_json(const CaseRecord& record, const CaseRecord* reference) {
  const ClockRecord* own = timed(record);
  const ClockRecord* other = reference != nullptr ? timed(*reference) : nullptr;
  if (own == nullptr || other == nullptr || own->updates.empty() || other->updates.empty()) {
    return nullptr;
  }
  const Statistics a = statistics_of(frame_times(*own));
  const Statistics b = statistics_of(frame_times(*other));
  if (!(b.mean > 0.0) || !(b.p50 > 0.0)) return nullptr;
  return {{"mean", a.mean / b.mean}, {"p50", a.p50 / b.p50}};
}

void add_accuracy(const ClockRecord& clock, Json& json) {
  json["max_error_m"] = nullptr;
  json["mean_error_m"] = nullptr;
  json["accuracy_checks"] = clock.accuracy_checks;
  if (clock.accuracy_checks == 0) return;
  json["max_error_m"] = clock.accuracy.max_error_m;
  json["mean_error_m"] = clock.accuracy.mean_error_m();
  json["compared_vox"] = clock.accuracy.compared_vox;
  json["differing_vox"] = clock.accuracy.differing_vox;
}

Json case_json(const CaseRecord& record, const RunProvenance& provenance,
               const MappingBenchmarkSettings& settings, std::span<const CaseRecord> cases) {
  const std::string unmet = unmet_expectations(record, settings.expect);
  Json json = {{"name", record.what.name},
               {"mapper", record.what.mapper},
               {"field", record.what.field},
               {"signed", record.is_signed},
               {"resolution_m", record.what.resolution_m},
               {"threads", provenance.threads},
               {"success", record.error.empty() && unmet.empty() && !record.interrupted},
               {"error", record.error},
               {"unmet", unmet}};
  const ClockRecord* clock = timed(record);
  if (clock == nullptr) return json;
  json["clock"] = record.every_frame ? "every_frame" : "real_time";
  json["frames"] = clock->updates.size();
  json["bad_frames"] = clock->bad_frames;
  json["frame_ms"] = statistics_json(frame_times(*clock));
  json["stages_ms"] = stages_json(*clock);
  json["ratio"] = ratio_json(record, reference_of(record, settings, cases));
  json["published_ms"] = record.what.published_ms ? Json(*record.what.published_ms) : Json(nullptr);
  add_accuracy(*clock, json);
  double memory_mib = 0.0;
  for (const UpdateRecord& update : clock->updates) {
    memory_mib = std::max(memory_mib, update.resident_mib);
  }
  json["memory_mib"] = memory_mib;
  json["quarters"] = quarters_json(*clock);
  json["truth"] = clock->truth ? truth_json(*clock->truth) : Json(nullptr);
  json["real_time"] = record.real_time ? real_time_json(*record.real_time) : Json(nullptr);
  return json;
}

std::string times_table(const Json& systems, const std::string& published_as) {
  return report::text_table({{"system", "/name"},
                             {"field", "/signed", "signed|unsigned"},
                             {"voxel", "/resolution_m", "%g m"},
                             {"frames", "/frames", "%.0f"},
                             {"mean", "/frame_ms/mean", "%.2f ms"},
                             {"sd", "/frame_ms/sd", "%.2f"},
                             {"p50", "/frame_ms/p50", "%.2f"},
                             {"p95", "/frame_ms/p95", "%.2f"},
                             {"integrate", "/stages_ms/integrate/mean", "%.2f"},
                             {"field", "/stages_ms/field/mean", "%.2f"},
                             {"publish", "/stages_ms/publish/mean", "%.2f"},
                             {"ratio", "/ratio/mean", "%.2f"},
                             {published_as, "/published_ms", "%g ms"},
                             {"max error", "/max_error_m", "%.4f m"},
                             {"mean error", "/mean_error_m", "%.2g m"},
                             {"memory", "/memory_mib", "%.0f MiB"}},
                            systems);
}

std::string truth_table(const Json& systems) {
  return report::text_table({{"against the scene", "/name"},
                             {"field", "/signed", "signed|unsigned"},
                             {"voxel", "/resolution_m", "%g m"},
                             {"recall", "/truth/collision_recall", "%.4f"},
                             {"occupied", "/truth/occupied_vox", "%.0f"},
                             {"false", "/truth/false_obstacle_vox", "%.0f"},
                             {"appears (max)", "/truth/appear_frames/max", "%.0f frames"},
                             {"gone (p95)", "/truth/gone_frames/p95", "%.0f"},
                             {"gone (max)", "/truth/gone_frames/max", "%.0f frames"},
                             {"ghosts", "/truth/ghost_vox", "%.0f"},
                             {"ghosts seen", "/truth/ghost_seen_vox", "%.0f"}},
                            systems);
}

std::string real_time_table(const Json& systems) {
  return report::text_table({{"in real time", "/name"},
                             {"field", "/signed", "signed|unsigned"},
                             {"voxel", "/resolution_m", "%g m"},
                             {"mapped", "/real_time/frames", "%.0f"},
                             {"dropped", "/real_time/dropped", "%.0f"},
                             {"share", "/real_time/dropped_share", "%.3f"},
                             {"rate", "/real_time/rate_hz", "%.1f Hz"},
                             {"latency p50", "/real_time/latency_ms/p50", "%.1f ms"},
                             {"p95", "/real_time/latency_ms/p95", "%.1f"},
                             {"max", "/real_time/latency_ms/max", "%.1f"}},
                            systems);
}

std::string table_text(const Json& systems, const std::string& published_as) {
  std::string text = times_table(systems, published_as);
  const Json with_truth = report::those_with("/truth", systems);
  if (!with_truth.empty()) text += "\n" + truth_table(with_truth);
  const Json in_real_time = report::those_with("/real_time", systems);
  if (!in_real_time.empty()) text += "\n" + real_time_table(in_real_time);
  return text;
}

std::string label_of(const CaseRecord& record) {
  return record.what.name + (record.is_signed ? ", signed" : "") + " at " +
         format("%g m", record.what.resolution_m);
}

std::string table_csv(const Json& systems) {
  constexpr std::array kColumns = {"/name",
                                   "/mapper",
                                   "/field",
                                   "/signed",
                                   "/resolution_m",
                                   "/threads",
                                   "/frames",
                                   "/frame_ms/mean",
                                   "/frame_ms/sd",
                                   "/frame_ms/p50",
                                   "/frame_ms/p95",
                                   "/frame_ms/max",
                                   "/stages_ms/integrate/mean",
                                   "/stages_ms/field/mean",
                                   "/stages_ms/publish/mean",
                                   "/ratio/mean",
                                   "/ratio/p50",
                                   "/published_ms",
                                   "/max_error_m",
                                   "/mean_error_m",
                                   "/memory_mib",
                                   "/truth/collision_recall",
                                   "/truth/false_obstacle_vox",
                                   "/truth/appear_frames/max",
                                   "/truth/gone_frames/max",
                                   "/truth/ghost_vox",
                                   "/truth/ghost_seen_vox",
                                   "/real_time/rate_hz",
                                   "/real_time/dropped_share",
                                   "/real_time/latency_ms/p50",
                                   "/real_time/latency_ms/p95",
                                   "/error"};
  return csv_text(systems, kColumns);
}

std::string verdict_text(const MappingBenchmarkSettings& settings,
                         const MappingBenchmarkRecord& record) {
  const std::string measured = std::to_string(record.cases.size()) + " of " +
                               std::to_string(record.planned_cases) + " cases";
  if (record.interrupted) return "Interrupted after " + measured + "; what was measured is saved.";
  std::string failures;
  std::size_t failed = 0;
  for (const CaseRecord& one : record.cases) {
    const std::string unmet = unmet_expectations(one, settings.expect);
    if (one.error.empty() && unmet.empty()) continue;
    ++failed;
    failures += " " + label_of(one) + ": " + (one.error.empty() ? unmet : one.error) + ".";
  }
  if (failed > 0) {
    return "Failed: " + std::to_string(failed) + " of " + std::to_string(record.cases.size()) +
           " cases did not do." + failures;
  }
  std::string text = "Success: " + measured + " were measured";
  for (const CaseRecord& one : record.cases) {
    const ClockRecord* clock = timed(one);
    if (one.what.name != settings.reference || clock == nullptr) continue;
    text += "; " + label_of(one) + " takes " +
            format("%.1f ms", statistics_of(frame_times(*clock)).p50) + " (p50)";
  }
  return text + ".";
}

}  // namespace

std::string unmet_expectations(const CaseRecord& record, const ExpectSettings& expect) {
  const ClockRecord* clock = record.every_frame ? &*record.every_frame : nullptr;
  std::string text;
  const auto complain = [&](const std::string& what, double found, double wanted) {
    text += (text.empty() ? "" : ", ") + what + " " + format("%g", found) + " instead of " +
            format("%g", wanted);
  };
  if (record.error.empty() && (clock == nullptr || clock->updates.empty()) && !record.real_time) {
    return "no frame could be mapped";
  }
  if (clock == nullptr) return "";
  if (expect.max_error_m && clock->accuracy.max_error_m > *expect.max_error_m) {
    complain("an error of (m)", clock->accuracy.max_error_m, *expect.max_error_m);
  }
  if (!clock->truth) return text;
  const TruthRecord& truth = *clock->truth;
  const auto largest = [](const std::vector<double>& values) {
    return values.empty() ? 0.0 : *std::ranges::max_element(values);
  };
  const auto recall = truth.collision_recall();
  if (expect.collision_recall && recall && *recall < *expect.collision_recall) {
    complain("a collision recall of", *recall, *expect.collision_recall);
  }
  if (expect.appear_frames && largest(truth.appear_frames) > *expect.appear_frames) {
    complain("frames until an object appears:", largest(truth.appear_frames),
             *expect.appear_frames);
  }
  if (expect.appear_frames && truth.never_appeared > 0) {
    complain("objects that never appear:", static_cast<double>(truth.never_appeared), 0.0);
  }
  if (expect.gone_frames && largest(truth.gone_frames) > *expect.gone_frames) {
    complain("frames until a voxel is gone:", largest(truth.gone_frames), *expect.gone_frames);
  }
  if (expect.ghost_vox && static_cast<double>(truth.ghost_seen_vox) > *expect.ghost_vox) {
    complain("ghost voxels left:", static_cast<double>(truth.ghost_seen_vox), *expect.ghost_vox);
  }
  return text;
}

ExperimentOutcome summarise_mapping(const RunProvenance& provenance,
                                    const MappingBenchmarkSettings& settings,
                                    const MappingBenchmarkRecord& record) {
  Json systems = Json::array();
  for (const CaseRecord& one : record.cases) {
    systems.push_back(case_json(one, provenance, settings, record.cases));
  }
  ExperimentOutcome outcome;
  outcome.interrupted = record.interrupted;
  outcome.success =
      !record.interrupted && !record.cases.empty() &&
      std::ranges::all_of(systems, [](const Json& s) { return at(s, "/success") == Json(true); });
  outcome.verdict = verdict_text(settings, record);
  outcome.table = table_text(systems, settings.published_as);
  outcome.table_csv = table_csv(systems);
  Json bad_frames = Json::array();
  for (const Error& error : record.bad_frames) bad_frames.push_back(error.describe());
  outcome.summary_json = summary_text(provenance, settings.type, outcome,
                                      {{"reference", settings.reference},
                                       {"published_as", settings.published_as},
                                       {"bad_frames", record.bad_frames.size()},
                                       {"bad_frame_errors", bad_frames},
                                       {"has_truth", record.has_truth},
                                       {"systems", systems}});
  return outcome;
}

}  // namespace sidestep
