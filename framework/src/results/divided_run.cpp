#include <sidestep/results/divided_run.hpp>

#include <algorithm>
#include <charconv>
#include <sstream>

#include <sidestep/results/run_provenance.hpp>
#include <sidestep/results/stored_values.hpp>
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

/// The effective configuration as far as it fixes outcomes.
std::string identity_of(const ExperimentContext& context) {
  Node root = context.effective;
  if (Node* experiment = root.find("experiment")) {
    std::erase_if(experiment->entries(), [](const auto& entry) { return entry.key == "threads"; });
  }
  return to_yaml(root, false);
}

}  // namespace

DividedRun divided_run_of(const ExperimentContext& context) {
  return {identity_of(context), provenance_of(context), context.shard, {}};
}

void record_run_head(const DividedRun& run, std::string_view series, Recorder& recorder) {
  const auto add = [&](std::string_view key, const auto& value) {
    recorder.add(series, 0, key, value);
  };
  add("identity", run.identity);
  add("configuration", run.provenance.configuration);
  add("version", run.provenance.version);
  add("git_hash", run.provenance.git_hash);
  add("build_flags", run.provenance.build_flags);
  add("cpu", run.provenance.cpu);
  add("threads", run.provenance.threads);
  add("seed", std::to_string(run.provenance.seed));
  add("shard_index", run.shard.index);
  add("shard_count", run.shard.count);
}

void record_session(const RunSession& session, std::int64_t index, Recorder& recorder) {
  recorder.add("session", index, "wall_s", session.wall_s);
  recorder.add("session", index, "cpu_s", session.cpu_s);
  recorder.add("session", index, "threads", session.threads);
  recorder.add("session", index, "problems", session.problems);
}

Result<void> read_run_head(ResultsReader& reader, const std::string& series,
                           const std::string& file, DividedRun& run) {
  ItemReader item(reader, series, 0, file);
  run.identity = item.text("identity");
  run.provenance.configuration = item.text("configuration");
  run.provenance.version = item.text("version");
  run.provenance.git_hash = item.text("git_hash");
  run.provenance.build_flags = item.text("build_flags");
  run.provenance.cpu = item.text("cpu");
  run.provenance.threads = item.integer("threads");
  const std::string seed = item.text("seed");
  std::from_chars(seed.data(), seed.data() + seed.size(), run.provenance.seed);
  run.shard = {item.integer("shard_index"), item.integer("shard_count")};
  if (item.error()) return tl::make_unexpected(*item.error());
  ColumnReader sessions(reader, "session", file);
  const auto wall_s = sessions.column("wall_s"), cpu_s = sessions.column("cpu_s");
  const auto threads = sessions.column("threads");
  const auto problems = sessions.column("problems");
  for (std::size_t i = 0; i < wall_s.size(); ++i) {
    run.sessions.push_back({wall_s[i], cpu_s[i], static_cast<int>(threads[i]),
                            static_cast<std::int64_t>(problems[i])});
  }
  if (sessions.error()) return tl::make_unexpected(*sessions.error());
  return {};
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

Result<void> check_same_run(const DividedRun& earlier, const DividedRun& here,
                            const std::string& file) {
  if (const std::string other = difference(earlier.identity, here.identity); !other.empty()) {
    return fail(ErrorCode::kConfig, "the run to resume is another one: " + other, file,
                "resume it with the configuration and overrides it began with");
  }
  if (earlier.shard.index != here.shard.index || earlier.shard.count != here.shard.count) {
    return fail(ErrorCode::kConfig, "the run to resume is shard " + shard_name(earlier.shard), file,
                "resume it with the same --shard");
  }
  if (earlier.provenance.git_hash != here.provenance.git_hash) {
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

}  // namespace sidestep
