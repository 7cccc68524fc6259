#include <sidestep/results/divided_run.hpp>

#include <algorithm>
#include <charconv>
#include <sstream>
#include <system_error>

#include <nlohmann/json.hpp>

#include <sidestep/results/summary.hpp>
#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    const std::size_t first = line.find_first_not_of(" -");
    lines.push_back(first == std::string::npos ? "" : line.substr(first));
  }
  return lines;
}

StoredRow<DividedRun> stored_head() {
  using Provenance = RunProvenance;
  const auto of = [](auto member) {
    return [member](auto& run) -> auto& { return run.provenance.*member; };
  };
  return StoredRow<DividedRun>()
      .add("identity", &DividedRun::identity)
      .add("configuration", of(&Provenance::configuration))
      .add("version", of(&Provenance::version))
      .add("git_hash", of(&Provenance::git_hash))
      .add("build_flags", of(&Provenance::build_flags))
      .add("cpu", of(&Provenance::cpu))
      .add("threads", of(&Provenance::threads))
      .add(
          "seed", [](const DividedRun& run) { return std::to_string(run.provenance.seed); },
          [](DividedRun& run, const std::string& text) {
            std::from_chars(text.data(), text.data() + text.size(), run.provenance.seed);
          })
      .add(
          "shard_index", [](auto& run) -> auto& { return run.shard.index; })
      .add(
          "shard_count", [](auto& run) -> auto& { return run.shard.count; });
}

StoredRow<RunSession> stored_session() {
  return StoredRow<RunSession>()
      .add("wall_s", &RunSession::wall_s)
      .add("cpu_s", &RunSession::cpu_s)
      .add("threads", &RunSession::threads)
      .add("problems", &RunSession::problems);
}

}  // namespace

DividedRun divided_run_of(const ExperimentContext& context) {
  return {identity_of(context), provenance_of(context), context.shard, {}};
}

std::string identity_of(const ExperimentContext& context, const std::vector<std::string>& without) {
  Node root = context.effective;
  if (Node* experiment = root.find("experiment")) {
    std::erase_if(experiment->entries(), [&](const Node::Entry& entry) {
      return std::ranges::find(without, entry.key) != without.end();
    });
  }
  return to_yaml(root, false);
}

Result<std::unique_ptr<ResultsStore>> open_store(const ExperimentContext& context,
                                                 const RunProvenance& provenance) {
  const auto file = context.out / "results.sqlite";
  return context.resume ? ResultsStore::reopen(file) : ResultsStore::open(file, provenance);
}

void record_session(const RunSession& session, std::int64_t index, Recorder& recorder) {
  stored_session().record(session, "session", index, recorder);
}

void record_run_head(const DividedRun& run, std::string_view series, Recorder& recorder) {
  stored_head().record(run, series, 0, recorder);
}

Result<DividedRun> read_run_head(ResultsReader& reader, const std::string& series,
                                 const std::string& file) {
  auto run = SIDESTEP_TRY(stored_head().read(reader, series, 0, file));
  auto sessions = SIDESTEP_TRY(stored_session().read_all(reader, "session", file));
  for (auto& [item, session] : sessions) run.sessions.push_back(session);
  return run;
}

std::string difference(const std::string& there, const std::string& here) {
  if (there == here) return "";
  const std::vector<std::string> a = lines_of(there), b = lines_of(here);
  const auto [at_a, at_b] = std::ranges::mismatch(a, b);
  const std::string nothing = "nothing";
  return "`" + (at_a == a.end() ? nothing : *at_a) + "` there, `" +
         (at_b == b.end() ? nothing : *at_b) + "` here";
}

std::string shard_name(const Shard& shard) {
  return std::to_string(shard.index + 1) + "/" + std::to_string(shard.count);
}

nlohmann::ordered_json shard_json(const Shard& shard) {
  if (shard.is_whole()) return nullptr;
  return {{"index", shard.index + 1}, {"count", shard.count}};
}

nlohmann::ordered_json time_json(const DividedRun& run) {
  double wall_s = 0.0, cpu_s = 0.0;
  for (const RunSession& session : run.sessions) {
    wall_s += session.wall_s;
    cpu_s += session.cpu_s;
  }
  return {{"sessions", run.sessions.size()}, {"wall_s", wall_s}, {"cpu_s", cpu_s}};
}

Result<void> check_same_run(const DividedRun& earlier, const DividedRun& here,
                            const std::string& file, bool any_build) {
  if (const std::string other = difference(earlier.identity, here.identity); !other.empty()) {
    return fail(ErrorCode::kConfig, "the run to resume is another one: " + other, file,
                "resume it with the configuration and overrides it began with");
  }
  if (earlier.shard.index != here.shard.index || earlier.shard.count != here.shard.count) {
    return fail(ErrorCode::kConfig, "the run to resume is shard " + shard_name(earlier.shard), file,
                "resume it with the same --shard");
  }
  if (!any_build && earlier.provenance.git_hash != here.provenance.git_hash) {
    return fail(ErrorCode::kConfig,
                "the run to resume was made by another build, " + earlier.provenance.git_hash +
                    "; this one is " + here.provenance.git_hash,
                file, "its outcomes may differ: begin anew");
  }
  return {};
}

Result<void> check_same_division(const DividedRun& first, const DividedRun& part,
                                 const std::filesystem::path& run) {
  if (const std::string other = difference(first.identity, part.identity); !other.empty()) {
    return fail(ErrorCode::kConfig, "the shard is of another run than the first: " + other,
                run.string(), "merge shards of one configuration");
  }
  if (part.shard.count != first.shard.count) {
    return fail(
        ErrorCode::kConfig,
        "the shard is " + shard_name(part.shard) + ", the first one is " + shard_name(first.shard),
        run.string(), "merge shards of one division");
  }
  if (part.provenance.git_hash != first.provenance.git_hash) {
    return fail(ErrorCode::kConfig,
                "the shard was made by another build, " + part.provenance.git_hash +
                    "; the first one by " + first.provenance.git_hash,
                run.string(), "their outcomes may differ: make all shards with one build");
  }
  return {};
}

Result<void> absorb_shards(const DividedRun& whole,
                           const std::vector<std::filesystem::path>& shards,
                           const std::filesystem::path& out, std::string_view head_series,
                           const std::function<void(Recorder&)>& record) {
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (error) {
    return fail(ErrorCode::kIo, "cannot make the folder: " + error.message(), out.string());
  }
  auto store = SIDESTEP_TRY(ResultsStore::open(out / "results.sqlite", whole.provenance));
  Recorder recorder(*store);
  record(recorder);
  for (const auto& shard : shards) {
    SIDESTEP_TRY(store->absorb(shard / "results.sqlite", head_series));
  }
  for (std::size_t s = 0; s < whole.sessions.size(); ++s) {
    record_session(whole.sessions[s], static_cast<std::int64_t>(s), recorder);
  }
  return recorder.commit();
}

}  // namespace sidestep
