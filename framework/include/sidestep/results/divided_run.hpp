#pragma once

#include <ctime>
#include <filesystem>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include <sidestep/core/time.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

/// A stretch of work on a run: one `sidestep run`, up to its end or its interruption.
struct RunSession {
  double wall_s = 0.0;
  double cpu_s = 0.0;  ///< Of all threads: what it takes where nothing else runs.
  int threads = 0;
  std::int64_t problems = 0;  ///< That it solved.
};

/// What a store holds of every run that can be divided into shards and gone on with.
struct DividedRun {
  std::string identity;  ///< The effective configuration that fixes every outcome, as YAML.
  RunProvenance provenance;
  Shard shard;
  std::vector<RunSession> sessions;
};

/// The part of a run that its context knows; no session yet.
[[nodiscard]] DividedRun divided_run_of(const ExperimentContext& context);

/// The effective configuration as far as it fixes outcomes, as YAML: without those keys of the
/// `experiment` block that do not.
[[nodiscard]] std::string identity_of(const ExperimentContext& context,
                                      const std::vector<std::string>& without = {"threads"});

/// The store of a run in the folder of its context: a new one, or the one that it goes on with.
[[nodiscard]] Result<std::unique_ptr<ResultsStore>> open_store(const ExperimentContext& context,
                                                               const RunProvenance& provenance);

/// Item 0 of `series`, e.g. "study".
void record_run_head(const DividedRun& run, std::string_view series, Recorder& recorder);
/// Series "session", item `index`.
void record_session(const RunSession& session, std::int64_t index, Recorder& recorder);

/// Reads both back. Fails with kIo where the store is of no such run.
[[nodiscard]] Result<DividedRun> read_run_head(ResultsReader& reader, const std::string& series,
                                               const std::string& file);

/// Measures the session that it begins.
class SessionClock {
 public:
  explicit SessionClock(int threads) { session_.threads = threads; }

  /// The session so far, with so many problems more than before.
  [[nodiscard]] const RunSession& after(std::int64_t problems) {
    session_.problems += problems;
    session_.wall_s = 1e-3 * watch_.elapsed_ms();
    session_.cpu_s = static_cast<double>(std::clock() - cpu_begin_) / CLOCKS_PER_SEC;
    return session_;
  }

 private:
  RunSession session_;
  Stopwatch watch_;
  std::clock_t cpu_begin_ = std::clock();
};

/// Says in what two identities differ, e.g. "`scenes: 100` there, `scenes: 50` here"; empty if in
/// nothing.
[[nodiscard]] std::string difference(const std::string& there, const std::string& here);

/// Fails with kConfig where the run in `file` is not one that `here` can go on with: one of the
/// same configuration and shard, by the same build unless any will do.
[[nodiscard]] Result<void> check_same_run(const DividedRun& earlier, const DividedRun& here,
                                          const std::string& file, bool any_build = false);

/// Fails with kConfig where the shard in `run` cannot be put together with the first one.
[[nodiscard]] Result<void> check_same_division(const DividedRun& first, const DividedRun& part,
                                               const std::filesystem::path& run);

/// "2/3"
[[nodiscard]] std::string shard_name(const Shard& shard);

/// `shard` of a summary; null for the whole.
[[nodiscard]] nlohmann::ordered_json shard_json(const Shard& shard);
/// `time` of a summary: that of all sessions.
[[nodiscard]] nlohmann::ordered_json time_json(const DividedRun& run);

/// Reads shards of one run with `read` and puts them together: `absorb` moves what a further one
/// has found into the first. Fails with kConfig where they do not fit or one is there twice.
template <class Record>
[[nodiscard]] Result<Record> merged_record(const std::vector<std::filesystem::path>& runs,
                                           Result<Record> (*read)(const std::filesystem::path&),
                                           void (*absorb)(Record& whole, Record part)) {
  std::optional<Record> whole;
  std::set<int> seen;
  for (const std::filesystem::path& run : runs) {
    auto part = SIDESTEP_TRY(read(run / "results.sqlite"));
    if (whole) {
      SIDESTEP_TRY(check_same_division(*whole, part, run));
    }
    if (!seen.insert(part.shard.index).second) {
      return fail(ErrorCode::kConfig, "shard " + shard_name(part.shard) + " is there twice",
                  run.string(), "give it once");
    }
    if (!whole) {
      whole = std::move(part);
      continue;
    }
    std::ranges::copy(part.sessions, std::back_inserter(whole->sessions));
    absorb(*whole, std::move(part));
  }
  whole->shard = {};
  return *std::move(whole);
}

/// Stores a whole in the folder `out`, which is made: what `record` adds to its store, what the
/// shards' stores hold but for `head_series`, and the sessions.
[[nodiscard]] Result<void> absorb_shards(const DividedRun& whole,
                                         const std::vector<std::filesystem::path>& shards,
                                         const std::filesystem::path& out,
                                         std::string_view head_series,
                                         const std::function<void(Recorder&)>& record);

/// Stores a whole in the folder `out`, which is made, and sums it up.
template <class Record>
[[nodiscard]] Result<ExperimentOutcome> conclude_whole(
    const Record& whole, const std::filesystem::path& out, void (*record)(const Record&, Recorder&),
    Result<ExperimentOutcome> (*sum_up)(const std::filesystem::path&, bool,
                                        const std::optional<Error>&)) {
  SIDESTEP_TRY(
      absorb_shards(whole, {}, out, {}, [&](Recorder& recorder) { record(whole, recorder); }));
  return sum_up(out, false, std::nullopt);
}

}  // namespace sidestep
