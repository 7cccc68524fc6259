#include "mapping_parts.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include <sidestep/results/summary.hpp>

namespace sidestep {
namespace {

using report::at;
using Json = nlohmann::ordered_json;

using Updates = std::vector<UpdateRecord>;

std::vector<double> frame_times(const Updates& updates) {
  return values_of(updates, &UpdateRecord::frame_ms);
}

double memory_mib(const Updates& updates) {
  return std::max(0.0, percentile(values_of(updates, &UpdateRecord::resident_mib), 1.0));
}

Json statistics_json(const std::vector<double>& values) {
  const Statistics s = statistics_of(values);
  return {{"mean", s.mean}, {"sd", s.sd}, {"p50", s.p50}, {"p95", s.p95}, {"max", s.max}};
}

/// Time and memory in each quarter of the run: whether they grow.
Json quarters_json(const Updates& updates) {
  Json quarters = Json::array();
  const auto count = std::ssize(updates);
  for (std::ptrdiff_t q = 0; q < 4 && count >= 4; ++q) {
    const Updates part(updates.begin() + q * count / 4, updates.begin() + (q + 1) * count / 4);
    quarters.push_back({{"frames", part.size()},
                        {"frame_ms", statistics_json(frame_times(part))},
                        {"memory_mib", memory_mib(part)}});
  }
  return quarters;
}

const ClockRecord* timed(const CaseRecord& record) {
  if (record.every_frame) return &*record.every_frame;
  return record.real_time ? &*record.real_time : nullptr;
}

/// Why a case does not reach what the settings expect; empty where it does.
std::string unmet_expectations(const CaseRecord& record, const ExpectSettings& expect) {
  const ClockRecord* clock = record.every_frame ? &*record.every_frame : nullptr;
  if (record.error.empty() && (clock == nullptr || clock->updates.empty()) && !record.real_time) {
    return "no frame could be mapped";
  }
  std::string text;
  const auto complain = [&](const std::string& what, double found, double wanted) {
    text += (text.empty() ? "" : ", ") + what + " " + format("%g", found) + " instead of " +
            format("%g", wanted);
  };
  const auto at_most = [&](const std::string& what, double found, std::optional<double> limit) {
    if (limit && found > *limit) complain(what, found, *limit);
  };
  if (clock == nullptr) return "";
  at_most("an error of (m)", clock->accuracy.max_error_m, expect.max_error_m);
  if (!clock->truth) return text;
  const TruthRecord& truth = *clock->truth;
  const auto largest = [](const std::vector<double>& values) { return percentile(values, 1.0); };
  const auto recall = truth.collision_recall();
  if (expect.collision_recall && recall && *recall < *expect.collision_recall) {
    complain("a collision recall of", *recall, *expect.collision_recall);
  }
  at_most("frames until an object appears:", largest(truth.appear_frames), expect.appear_frames);
  if (expect.appear_frames) {
    at_most("objects that never appear:", static_cast<double>(truth.never_appeared), 0.0);
  }
  at_most("frames until a voxel is gone:", largest(truth.gone_frames), expect.gone_frames);
  at_most("ghost voxels left:", static_cast<double>(truth.ghost_seen_vox), expect.ghost_vox);
  return text;
}

/// A case as it is told of.
struct SystemRow {
  const CaseRecord& record;
  const MappingBenchmarkRecord& whole;
  std::string unmet = unmet_expectations(record, whole.expect);
  const ClockRecord* clock = timed(record);  ///< Null where it could not be measured.

  [[nodiscard]] const TruthRecord* truth() const {
    return clock != nullptr && clock->truth ? &*clock->truth : nullptr;
  }
  [[nodiscard]] const ClockRecord* real_time() const {
    return record.real_time ? &*record.real_time : nullptr;
  }
};

/// `value` of a part of a row, one or several; nothing where there is no such part.
template <class Part, class Value>
auto of_part(Part part, Value value) {
  return [=](const SystemRow& row) {
    const auto* found = std::invoke(part, row);
    using Found = std::decay_t<decltype(std::invoke(value, *found))>;
    using Shown = std::conditional_t<std::is_same_v<Found, std::vector<double>>, Found, Json>;
    return found != nullptr ? Shown(std::invoke(value, *found)) : Shown();
  };
}

/// The whole time of every update.
auto times_of(auto clock) {
  return of_part(clock, [](const ClockRecord& c) { return frame_times(c.updates); });
}

/// One time of every update.
auto of_updates(double UpdateRecord::*time) {
  return [time](const ClockRecord& clock) { return values_of(clock.updates, time); };
}

/// By what factor an update takes longer than the reference's; null where nothing can be compared.
auto ratio_of(double Statistics::*statistic) {
  return [statistic](const SystemRow& row) -> Json {
    const auto reference = std::ranges::find_if(row.whole.cases, [&](const CaseRecord& other) {
      return other.what.name == row.whole.reference && other.is_signed == row.record.is_signed &&
             std::abs(other.what.resolution_m - row.record.what.resolution_m) < kSameResolution;
    });
    const ClockRecord* other = reference != row.whole.cases.end() ? timed(*reference) : nullptr;
    if (row.clock == nullptr || other == nullptr) return nullptr;
    const double theirs = statistics_of(frame_times(other->updates)).*statistic;
    if (row.clock->updates.empty() || !(theirs > 0.0)) return nullptr;
    return statistics_of(frame_times(row.clock->updates)).*statistic / theirs;
  };
}

/// What the field was compared with; null where it was not.
auto of_accuracy(auto value) {
  return [value](const SystemRow& row) -> Json {
    if (row.clock == nullptr || row.clock->accuracy_checks == 0) return nullptr;
    return static_cast<double>(std::invoke(value, row.clock->accuracy));
  };
}

double dropped_share(const ClockRecord& clock) {
  const auto lost = static_cast<double>(clock.dropped + clock.bad_frames);
  const double arrived = static_cast<double>(clock.updates.size()) + lost;
  return arrived > 0.0 ? static_cast<double>(clock.dropped) / arrived : 0.0;
}

double rate_hz(const ClockRecord& clock) {
  const auto updates = static_cast<double>(clock.updates.size());
  return clock.duration_s > 0.0 ? (updates - 1.0) / clock.duration_s : 0.0;
}

const std::vector<std::string> kAllStatistics = {"mean", "sd", "p50", "p95", "max"};

void add_times_and_errors(report::ResultColumnsOf<SystemRow>& columns) {
  using R = SystemRow;
  using U = UpdateRecord;
  using A = FieldAccuracy;
  const auto clock = &R::clock;
  columns
      .table("Time of an update",
             "Ratio: to the mean of the run's `reference` with the same kind of field at the same "
             "resolution. Published: the figure that the configuration gives.")
      .add(
          "clock",
          [](const R& r) {
            return r.clock == nullptr     ? Json(nullptr)
                   : r.record.every_frame ? Json("every_frame")
                                          : Json("real_time");
          },
          "Whether these are times of every frame or of those mapped in real time.")
      .add("frames", of_part(clock, [](const ClockRecord& c) { return c.updates.size(); }),
           "Frames that were mapped.", {.heading = "frames", .pattern = "%.0f", .compared = true})
      .add("bad_frames", of_part(clock, &ClockRecord::bad_frames),
           "Frames that the mapper refused.")
      .spread("frame_ms.", times_of(clock),
              "Wall time from the frame in hand to the published field that has it.",
              kAllStatistics,
              {.heading = "frame",
               .pattern = "%.2f ms",
               .compared = true,
               .statistics = "mean sd p50 p95"})
      .spread("stages_ms.integrate.", of_part(clock, of_updates(&U::integrate_ms)),
              "Of it, in the mapper.", kAllStatistics,
              {.heading = "integrate", .pattern = "%.2f", .statistics = "mean"})
      .spread("stages_ms.field.", of_part(clock, of_updates(&U::field_ms)), "Of it, in the field.",
              kAllStatistics, {.heading = "field", .pattern = "%.2f", .statistics = "mean"})
      .spread("stages_ms.publish.", of_part(clock, of_updates(&U::publish_ms)),
              "Of it, until readers have it.", kAllStatistics,
              {.heading = "publish", .pattern = "%.2f", .statistics = "mean"})
      .add("ratio.mean", ratio_of(&Statistics::mean), "Mean over that of the reference.",
           {.heading = "ratio", .pattern = "%.2f"})
      .add("ratio.p50", ratio_of(&Statistics::p50), "Median over that of the reference.")
      .add("published_ms",
           [](const R& r) {
             return r.record.what.published_ms ? Json(*r.record.what.published_ms) : Json(nullptr);
           },
           "What was published of the same, as the configuration says.",
           {.heading = "published", .pattern = "%g ms"})
      .table("Fields against the exact transform of their own maps; memory")
      .add("max_error_m", of_accuracy(&A::max_error_m), "Largest error of the field.",
           {.heading = "max error", .pattern = "%.4f m", .compared = true})
      .add("mean_error_m", of_accuracy(&A::mean_error_m), "Mean error of the field.",
           {.heading = "mean error", .pattern = "%.2g m", .compared = true})
      .add("accuracy_checks", of_part(clock, &ClockRecord::accuracy_checks),
           "Fields that were compared.")
      .add("compared_vox", of_accuracy(&A::compared_vox), "Voxels that were compared.",
           {.heading = "voxels compared", .pattern = "%.0f"})
      .add("differing_vox", of_accuracy(&A::differing_vox), "Voxels that differ.",
           {.heading = "that differ", .pattern = "%.0f"})
      .add("memory_mib", of_part(clock, [](const ClockRecord& c) { return memory_mib(c.updates); }),
           "Most memory of the process, beyond what it had before the system was made.",
           {.heading = "memory", .pattern = "%.0f MiB", .compared = true});
}

void add_truth(report::ResultColumnsOf<SystemRow>& columns) {
  using T = TruthRecord;
  const auto truth = &SystemRow::truth;
  const auto count = [&](const char* key, std::int64_t T::*member, const char* meaning,
                         const char* heading = "") {
    columns.add(std::string("truth.") + key, of_part(truth, member), meaning,
                {.heading = heading, .pattern = "%.0f"});
  };
  columns.table("Maps against the true scene")
      .add("truth.collision_recall",
           of_part(truth,
                   [](const T& t) {
                     const auto recall = t.collision_recall();
                     return recall ? Json(*recall) : Json(nullptr);
                   }),
           "Share of the surface voxels seen that have an occupied voxel no farther than one away.",
           {.heading = "recall", .pattern = "%.4f"});
  count("surface_vox", &T::surface_vox, "Voxels in which the camera saw a surface.");
  count("occupied_vox", &T::occupied_vox, "Occupied voxels.", "occupied");
  count("false_obstacle_vox", &T::false_vox,
        "Occupied voxels with no surface within their diagonal.", "false");
  columns
      .spread("truth.appear_frames.", of_part(truth, &T::appear_frames),
              "Frames from when an object comes into view until it is in the map.", kAllStatistics,
              {.heading = "appears", .pattern = "%.0f frames", .statistics = "max"})
      .add("truth.appear_frames.events",
           of_part(truth, [](const T& t) { return t.appear_frames.size(); }),
           "How often one came into view.")
      .add("truth.never_appeared", of_part(truth, &T::never_appeared),
           "Objects that left the view before they were in the map.")
      .spread("truth.gone_frames.", of_part(truth, &T::gone_frames),
              "Frames of seeing through a voxel that was left until it is free.", kAllStatistics,
              {.heading = "gone", .pattern = "%.0f frames", .statistics = "p95 max"})
      .add("truth.gone_frames.voxels",
           of_part(truth, [](const T& t) { return t.gone_frames.size(); }),
           "Voxels that were left.");
  count("ghost_vox", &T::ghost_vox, "Voxels that were left and are occupied at the end.", "ghosts");
  count("ghost_seen_vox", &T::ghost_seen_vox, "Of these, seen through at least once.",
        "ghosts seen");
}

void add_real_time(report::ResultColumnsOf<SystemRow>& columns) {
  const auto clock = &SystemRow::real_time;
  columns.table("In real time, late frames dropped")
      .add("real_time.frames",
           of_part(clock, [](const ClockRecord& c) { return c.updates.size(); }),
           "Frames that were mapped.", {.heading = "mapped", .pattern = "%.0f"})
      .add("real_time.dropped", of_part(clock, &ClockRecord::dropped), "Frames that came too late.",
           {.heading = "dropped", .pattern = "%.0f"})
      .add("real_time.dropped_share", of_part(clock, &dropped_share),
           "Their share of what arrived.", {.heading = "share", .pattern = "%.3f"})
      .add("real_time.rate_hz", of_part(clock, &rate_hz), "Fields a second.",
           {.heading = "rate", .pattern = "%.1f Hz"})
      .spread("real_time.frame_ms.", times_of(clock), "As `frame_ms`.", kAllStatistics)
      .spread("real_time.latency_ms.", of_part(clock, of_updates(&UpdateRecord::latency_ms)),
              "From a frame's arrival to the published field that has it.", kAllStatistics,
              {.heading = "latency", .pattern = "%.1f ms", .statistics = "p50 p95 max"});
}

const report::ResultColumnsOf<SystemRow>& mapping_systems() {
  using R = SystemRow;
  static const auto kColumns = [] {
    report::ResultColumnsOf<R> columns("/systems");
    columns
        .add("name", [](const R& r) { return r.record.what.name; }, "Name of the case.",
             {.heading = "system", .compared = true})
        .add(
            "mapper", [](const R& r) { return r.record.what.mapper; }, "Its mapper.")
        .add(
            "field", [](const R& r) { return r.record.what.field; }, "Its field.")
        .add("signed", [](const R& r) { return r.record.is_signed; },
             "Whether the field is negative inside obstacles.",
             {.heading = "field", .pattern = "signed|unsigned", .compared = true})
        .add("resolution_m", [](const R& r) { return r.record.what.resolution_m; },
             "Edge of a voxel.", {.heading = "voxel", .pattern = "%g m", .compared = true})
        .add(
            "threads", [](const R& r) { return r.whole.provenance.threads; }, "Threads of the run.")
        .add(
            "success",
            [](const R& r) {
              return r.record.error.empty() && r.unmet.empty() && !r.record.interrupted;
            },
            "Whether it was measured and does what `experiment.expect` asks.")
        .add(
            "error", [](const R& r) { return r.record.error; }, "Why it could not be measured.")
        .add("unmet", &R::unmet, "What it does not do of `experiment.expect`.");
    add_times_and_errors(columns);
    add_truth(columns);
    add_real_time(columns);
    return columns;
  }();
  return kColumns;
}

Json system_json(const SystemRow& row) {
  Json json = mapping_systems().row(row);
  if (const TruthRecord* truth = row.truth(); truth == nullptr) {
    json["truth"] = nullptr;
  } else {
    if (truth->appear_frames.empty()) json["truth"]["appear_frames"] = nullptr;
    if (truth->gone_frames.empty()) json["truth"]["gone_frames"] = nullptr;
  }
  if (row.real_time() == nullptr) json["real_time"] = nullptr;
  json["quarters"] = row.clock != nullptr ? quarters_json(row.clock->updates) : Json::array();
  return json;
}

std::string verdict_text(const MappingBenchmarkRecord& record, bool interrupted,
                         const std::optional<Error>& fault) {
  const std::string measured =
      std::to_string(record.cases.size()) + " of " + std::to_string(record.planned()) + " cases";
  if (fault) return "Ended early, after " + measured + ": " + fault->describe();
  if (interrupted) {
    return "Interrupted after " + measured + "; what was measured is saved, --resume goes on.";
  }
  const std::string part =
      record.shard.is_whole() ? "" : "Shard " + shard_name(record.shard) + ": ";
  if (!record.complete()) return part + "Incomplete: " + measured + ".";
  std::string failures;
  std::size_t failed = 0;
  for (const CaseRecord& one : record.cases) {
    const std::string unmet = unmet_expectations(one, record.expect);
    if (one.error.empty() && unmet.empty()) continue;
    ++failed;
    failures +=
        " " + one.what.label(one.is_signed) + ": " + (one.error.empty() ? unmet : one.error) + ".";
  }
  if (failed > 0) {
    return part + "Failed: " + std::to_string(failed) + " of " +
           std::to_string(record.cases.size()) + " cases did not do." + failures;
  }
  std::string text = part + "Success: " + measured + " were measured";
  for (const CaseRecord& one : record.cases) {
    const ClockRecord* clock = timed(one);
    if (one.what.name != record.reference || clock == nullptr) continue;
    text += "; " + one.what.label(one.is_signed) + " takes " +
            format("%.1f ms", statistics_of(frame_times(clock->updates)).p50) + " (p50)";
  }
  return text + ".";
}

}  // namespace

const report::ResultColumns& mapping_columns() { return mapping_systems(); }

ExperimentOutcome summarise_mapping(const MappingBenchmarkRecord& record, bool stopped,
                                    const std::optional<Error>& fault) {
  Json systems = Json::array();
  for (const CaseRecord& one : record.cases) systems.push_back(system_json({one, record}));
  ExperimentOutcome outcome;
  outcome.fault = fault;
  outcome.interrupted = stopped && !record.complete();
  outcome.success = record.complete() && !fault && std::ranges::all_of(systems, [](const Json& s) {
                      return at(s, "/success") == Json(true);
                    });
  outcome.verdict = verdict_text(record, outcome.interrupted, fault);
  outcome.table = mapping_systems().text(systems);
  if (!record.published_as.empty()) outcome.table += "published: " + record.published_as + "\n";
  outcome.table_csv = mapping_systems().csv(systems);
  const bool has_truth = std::ranges::any_of(record.cases, &CaseRecord::has_truth);
  outcome.summary_json = summary_text(record.provenance, "mapping_benchmark", outcome,
                                      {{"fault", fault ? Json(fault->describe()) : Json(nullptr)},
                                       {"complete", record.complete()},
                                       {"shard", shard_json(record.shard)},
                                       {"reference", record.reference},
                                       {"published_as", record.published_as},
                                       {"bad_frames", record.bad_frames.size()},
                                       {"bad_frame_errors", record.bad_frames},
                                       {"has_truth", has_truth},
                                       {"systems", systems},
                                       {"time", time_json(record)}});
  return outcome;
}

}  // namespace sidestep
