#include <algorithm>
#include <set>

#include <nlohmann/json.hpp>

#include <sidestep/experiments/report.hpp>

#include "html.hpp"
#include "save_outcome.hpp"
#include "study_rows.hpp"
#include "study_summary.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;

std::string shard_name(const Shard& shard) {
  return std::to_string(shard.index + 1) + "/" + std::to_string(shard.count);
}

Error refusal(std::string message, const fs::path& run, std::string hint) {
  return Error{ErrorCode::kConfig, std::move(message), run.string(), std::move(hint), nullptr};
}

/// What keeps `part` from being put together with `first`; nothing if nothing does.
std::optional<Error> mismatch(const StudyRecord& first, const StudyRecord& part,
                              const fs::path& run) {
  if (const std::string other = difference(first.identity, part.identity); !other.empty()) {
    return refusal("the shard is of another study than the first: " + other, run,
                   "merge shards of one configuration");
  }
  if (part.shard.count != first.shard.count) {
    return refusal(
        "the shard is " + shard_name(part.shard) + ", the first one is " + shard_name(first.shard),
        run, "merge shards of one division");
  }
  if (part.provenance.git_hash != first.provenance.git_hash) {
    return refusal("the shard was made by another build, " + part.provenance.git_hash +
                       "; the first one by " + first.provenance.git_hash,
                   run, "their outcomes may differ: make all shards with one build");
  }
  return std::nullopt;
}

/// Moves what a part has found into the whole.
void absorb(StudyRecord& whole, StudyRecord part) {
  std::ranges::copy(part.sessions, std::back_inserter(whole.sessions));
  for (std::size_t r = 0; r < whole.robots.size(); ++r) {
    std::ranges::copy(part.robots[r].drawn, std::back_inserter(whole.robots[r].drawn));
    std::ranges::copy(part.robots[r].problems, std::back_inserter(whole.robots[r].problems));
  }
}

Result<StudyRecord> merged_record(const std::vector<fs::path>& runs) {
  std::optional<StudyRecord> whole;
  std::set<int> seen;
  for (const fs::path& run : runs) {
    auto part = read_study(run / "results.sqlite");
    if (!part) return part;
    if (whole) {
      if (auto error = mismatch(*whole, *part, run)) return tl::make_unexpected(std::move(*error));
    }
    if (!seen.insert(part->shard.index).second) {
      return tl::make_unexpected(
          refusal("shard " + shard_name(part->shard) + " is there twice", run, "give it once"));
    }
    if (!whole) {
      whole = std::move(*part);
    } else {
      absorb(*whole, std::move(*part));
    }
  }
  whole->shard = {};
  for (StudyRobotRows& robot : whole->robots) robot.planned = robot.pairs() * robot.scenes;
  return *std::move(whole);
}

Result<void> store(const StudyRecord& study, const fs::path& file) {
  auto opened = ResultsStore::open(file, study.provenance);
  if (!opened) return tl::make_unexpected(std::move(opened.error()));
  Recorder recorder(**opened);
  record_study(study, recorder);
  for (std::size_t s = 0; s < study.sessions.size(); ++s) {
    record_session(study.sessions[s], static_cast<std::int64_t>(s), recorder);
  }
  for (std::size_t r = 0; r < study.robots.size(); ++r) {
    for (const SceneRow& scene : study.robots[r].drawn) record_scene(scene, r, recorder);
    for (const ProblemOutcome& problem : study.robots[r].problems) {
      record_problem(problem, r, recorder);
    }
  }
  return recorder.commit();
}

}  // namespace

bool are_shards(const std::vector<fs::path>& runs) {
  return !runs.empty() && std::ranges::all_of(runs, [](const fs::path& run) {
    const auto text = read_file(run / "summary.json");
    if (!text) return false;
    const auto summary = nlohmann::json::parse(*text, nullptr, false);
    const auto shard = summary.is_object() ? summary.find("shard") : summary.end();
    return summary.is_object() && shard != summary.end() && shard->is_object();
  });
}

Result<ExperimentOutcome> merge_shards(const std::vector<fs::path>& runs, const fs::path& out) {
  std::error_code error;
  for (const fs::path& run : runs) {
    if (!fs::equivalent(run, out, error)) continue;
    return fail(ErrorCode::kConfig, "the folder holds one of the shards", out.string(),
                "give another one with --merged");
  }
  const auto study = merged_record(runs);
  if (!study) return tl::make_unexpected(study.error());
  fs::create_directories(out, error);
  if (error) {
    return fail(ErrorCode::kIo, "cannot make the folder: " + error.message(), out.string());
  }
  if (auto stored = store(*study, out / "results.sqlite"); !stored) {
    return tl::make_unexpected(std::move(stored.error()));
  }
  auto outcome = conclude_study(out, false, std::nullopt);
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
