#include <algorithm>

#include <nlohmann/json.hpp>

#include <sidestep/experiments/report.hpp>

#include "planners/planner_summary.hpp"
#include "report/html.hpp"
#include "results/save_outcome.hpp"
#include "study/study_rows.hpp"
#include "study/study_summary.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// summary.json of a run; null where there is none.
Json summary_of(const fs::path& run) {
  const auto text = read_file(run / "summary.json");
  Json summary = text ? Json::parse(*text, nullptr, false) : Json();
  return summary.is_object() ? summary : Json();
}

/// Stores the whole in the folder `out` and sums it up.
template <class Record>
Result<ExperimentOutcome> conclude(
    const Record& whole, const fs::path& out, void (*record)(const Record&, Recorder&),
    Result<ExperimentOutcome> (*sum_up)(const fs::path&, bool, const std::optional<Error>&)) {
  std::error_code error;
  fs::create_directories(out, error);
  if (error) {
    return fail(ErrorCode::kIo, "cannot make the folder: " + error.message(), out.string());
  }
  auto store = ResultsStore::open(out / "results.sqlite", whole.provenance);
  if (!store) return tl::make_unexpected(std::move(store.error()));
  Recorder recorder(**store);
  record(whole, recorder);
  for (std::size_t s = 0; s < whole.sessions.size(); ++s) {
    record_session(whole.sessions[s], static_cast<std::int64_t>(s), recorder);
  }
  if (auto saved = recorder.commit(); !saved) return tl::make_unexpected(std::move(saved.error()));
  store->reset();
  return sum_up(out, false, std::nullopt);
}

/// Moves what a part has found into the whole.
void absorb_study(StudyRecord& whole, StudyRecord part) {
  for (std::size_t r = 0; r < whole.robots.size(); ++r) {
    std::ranges::copy(part.robots[r].drawn, std::back_inserter(whole.robots[r].drawn));
    std::ranges::copy(part.robots[r].problems, std::back_inserter(whole.robots[r].problems));
  }
}

void record_whole_study(const StudyRecord& study, Recorder& recorder) {
  record_study(study, recorder);
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    for (const SceneRow& scene : study.robots[r].drawn) record_scene(scene, r, recorder);
    for (const ProblemOutcome& problem : study.robots[r].problems) {
      record_problem(problem, r, recorder);
    }
  }
}

Result<ExperimentOutcome> merge_study(const std::vector<fs::path>& runs, const fs::path& out) {
  auto study = merged_record(runs, &read_study, &absorb_study);
  if (!study) return tl::make_unexpected(std::move(study.error()));
  for (StudyRobotRows& robot : study->robots) robot.planned = robot.pairs() * robot.scenes;
  return conclude(*study, out, &record_whole_study, &conclude_study);
}

Result<ExperimentOutcome> merge_planners(const std::vector<fs::path>& runs, const fs::path& out) {
  auto whole = merged_record(runs, &read_planner_record, &absorb_planners);
  if (!whole) return tl::make_unexpected(std::move(whole.error()));
  for (const fs::path& run : runs) {
    const auto part = read_planner_record(run / "results.sqlite");
    if (part && part->names == whole->names) continue;
    return fail(ErrorCode::kConfig, "this shard is of other problems than the first", run.string());
  }
  return conclude(*whole, out, &record_planners, &conclude_planners);
}

}  // namespace

bool are_shards(const std::vector<fs::path>& runs) {
  return !runs.empty() && std::ranges::all_of(runs, [](const fs::path& run) {
    const Json summary = summary_of(run);
    return summary.contains("shard") && summary["shard"].is_object();
  });
}

Result<ExperimentOutcome> merge_shards(const std::vector<fs::path>& runs, const fs::path& out) {
  std::error_code error;
  for (const fs::path& run : runs) {
    if (!fs::equivalent(run, out, error)) continue;
    return fail(ErrorCode::kConfig, "the folder holds one of the shards", out.string(),
                "give another one with --merged");
  }
  const bool are_of_planners =
      summary_of(runs.front()).value("experiment", "") == "planner_benchmark";
  auto outcome = are_of_planners ? merge_planners(runs, out) : merge_study(runs, out);
  if (!outcome) return outcome;
  Result<void> written;
  if (const auto configuration = read_file(runs.front() / "effective_config.yaml")) {
    written = write_file(out / "effective_config.yaml", *configuration);
  }
  if (written) written = save_outcome(*outcome, out);
  if (!written) return tl::make_unexpected(std::move(written.error()));
  return outcome;
}

}  // namespace sidestep
