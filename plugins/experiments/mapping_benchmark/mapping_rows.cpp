#include "mapping_parts.hpp"

#include <array>
#include <utility>

#include <sidestep/results/recorder.hpp>

namespace sidestep {
namespace {

constexpr const char* kHeadSeries = "benchmark";

/// A clock, and the series that has it.
constexpr std::array kClocks = {std::pair("update", &CaseRecord::every_frame),
                                std::pair("real_time", &CaseRecord::real_time)};

StoredRow<MappingBenchmarkRecord> stored_head() {
  using Record = MappingBenchmarkRecord;
  const auto of = [](auto member) {
    return [member](auto& record) -> auto& { return record.expect.*member; };
  };
  return StoredRow<Record>()
      .add("reference", &Record::reference)
      .add("published_as", &Record::published_as)
      .add("all_cases", &Record::all_cases)
      .add("expect.max_error_m", of(&ExpectSettings::max_error_m))
      .add("expect.collision_recall", of(&ExpectSettings::collision_recall))
      .add("expect.appear_frames", of(&ExpectSettings::appear_frames))
      .add("expect.gone_frames", of(&ExpectSettings::gone_frames))
      .add("expect.ghost_vox", of(&ExpectSettings::ghost_vox));
}

StoredRow<CaseRecord> stored_case() {
  using Case = CaseRecord;
  const auto of = [](auto member) {
    return [member](auto& record) -> auto& { return record.what.*member; };
  };
  return StoredRow<Case>()
      .add("name", of(&SystemCase::name))
      .add("mapper", of(&SystemCase::mapper))
      .add("field", of(&SystemCase::field))
      .add("resolution_m", of(&SystemCase::resolution_m))
      .add("published_ms", of(&SystemCase::published_ms))
      .add("signed", &Case::is_signed)
      .add("error", &Case::error)
      .add("has_truth", &Case::has_truth)
      .add("interrupted", &Case::interrupted);
}

StoredRow<ClockRecord> stored_clock() {
  using Clock = ClockRecord;
  const auto of = [](auto member) {
    return [member](auto& clock) -> auto& { return clock.accuracy.*member; };
  };
  return StoredRow<Clock>()
      // Of a case that was interrupted once, the store may hold more.
      .add(
          "frames", [](const Clock& clock) { return clock.updates.size(); },
          [](Clock& clock, std::size_t count) { clock.updates.resize(count); })
      .add("bad_frames", &Clock::bad_frames)
      .add("dropped", &Clock::dropped)
      .add("duration_s", &Clock::duration_s)
      .add("accuracy_checks", &Clock::accuracy_checks)
      .add("compared_vox", of(&FieldAccuracy::compared_vox))
      .add("differing_vox", of(&FieldAccuracy::differing_vox))
      .add("max_error_m", of(&FieldAccuracy::max_error_m))
      .add("sum_error_m", of(&FieldAccuracy::sum_error_m));
}

StoredRow<TruthRecord> stored_truth() {
  using Truth = TruthRecord;
  return StoredRow<Truth>()
      .add("surface_vox", &Truth::surface_vox)
      .add("surface_found_vox", &Truth::surface_found_vox)
      .add("occupied_vox", &Truth::occupied_vox)
      .add("false_vox", &Truth::false_vox)
      .add("appear_frames", &Truth::appear_frames)
      .add("never_appeared", &Truth::never_appeared)
      .add("gone_frames", &Truth::gone_frames)
      .add("ghost_vox", &Truth::ghost_vox)
      .add("ghost_seen_vox", &Truth::ghost_seen_vox);
}

StoredRow<UpdateRecord> stored_update() {
  using Update = UpdateRecord;
  return StoredRow<Update>()
      .add("sequence", &Update::frame_sequence)
      .add("integrate_ms", &Update::integrate_ms)
      .add("field_ms", &Update::field_ms)
      .add("publish_ms", &Update::publish_ms)
      .add_derived("frame_ms", &Update::frame_ms)
      .add("latency_ms", &Update::latency_ms)
      .add("resident_mib", &Update::resident_mib);
}

std::string updates_of(const char* clock, std::int64_t item) {
  return std::string(clock) + "/" + std::to_string(item);
}

CaseRecord* find_case(MappingBenchmarkRecord& record, std::int64_t index) {
  const auto found = std::ranges::find(record.cases, index, &CaseRecord::index);
  return found != record.cases.end() ? &*found : nullptr;
}

Result<MappingBenchmarkRecord> read_head(ResultsReader& reader, const std::string& file) {
  auto record = SIDESTEP_TRY(stored_head().read(reader, kHeadSeries, 0, file));
  static_cast<DividedRun&>(record) = SIDESTEP_TRY(read_run_head(reader, kHeadSeries, file));
  return record;
}

Result<MappingBenchmarkRecord> read_head_of(const std::filesystem::path& file) {
  auto reader = SIDESTEP_TRY(ResultsReader::open(file));
  return read_head(*reader, file.string());
}

}  // namespace

void record_mapping_head(const MappingBenchmarkRecord& record, Recorder& recorder) {
  record_run_head(record, kHeadSeries, recorder);
  stored_head().record(record, kHeadSeries, 0, recorder);
}

void record_case(const CaseRecord& record, Recorder& recorder) {
  stored_case().record(record, "system", record.index, recorder);
  for (const auto& [name, member] : kClocks) {
    const auto& clock = record.*member;
    if (!clock) continue;
    stored_clock().record(*clock, name, record.index, recorder);
    stored_update().record_all(clock->updates, updates_of(name, record.index), recorder);
    if (clock->truth) stored_truth().record(*clock->truth, "truth", record.index, recorder);
  }
}

Result<MappingBenchmarkRecord> read_mapping_record(const std::filesystem::path& path) {
  const std::string file = path.string();
  auto reader = SIDESTEP_TRY(ResultsReader::open(path));
  auto record = SIDESTEP_TRY(read_head(*reader, file));
  auto cases = SIDESTEP_TRY(stored_case().read_all(*reader, "system", file));
  for (auto& [index, one] : cases) {
    one.index = index;
    record.cases.push_back(std::move(one));
  }
  for (const auto& [name, member] : kClocks) {
    auto clocks = SIDESTEP_TRY(stored_clock().read_all(*reader, name, file));
    for (auto& [index, clock] : clocks) {
      const auto updates =
          SIDESTEP_TRY(stored_update().read_all(*reader, updates_of(name, index), file));
      for (std::size_t u = 0; u < std::min(clock.updates.size(), updates.size()); ++u) {
        clock.updates[u] = updates[u].second;
      }
      if (CaseRecord* its = find_case(record, index)) its->*member = std::move(clock);
    }
  }
  auto truths = SIDESTEP_TRY(stored_truth().read_all(*reader, "truth", file));
  for (auto& [index, truth] : truths) {
    CaseRecord* its = find_case(record, index);
    if (its != nullptr && its->every_frame) its->every_frame->truth = std::move(truth);
  }
  for (std::int64_t item = 0;; ++item) {
    auto error = SIDESTEP_TRY(reader->text("bad_frame", item, "error"));
    if (!error) return record;
    record.bad_frames.push_back(*std::move(error));
  }
}

Result<void> merge_mapping(const std::vector<std::filesystem::path>& shards,
                           const std::filesystem::path& out) {
  const auto whole = SIDESTEP_TRY(merged_record(
      shards, &read_head_of, +[](MappingBenchmarkRecord&, MappingBenchmarkRecord) {}));
  return absorb_shards(whole, shards, out, kHeadSeries,
                       [&](Recorder& recorder) { record_mapping_head(whole, recorder); });
}

}  // namespace sidestep
