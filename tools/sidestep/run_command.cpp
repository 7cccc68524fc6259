#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "commands.hpp"
#include "jobs.hpp"
#include "run_recorder.hpp"
#include "view_feed.hpp"

namespace sidestep {
namespace {

/// Who looks on at one run, told one after the other: a recorder, and the viewer's feed.
class Observers final : public RunObserver {
 public:
  /// Those that `options` ask for. Fails with kConfig where the file to record into exists, with
  /// kIo where it cannot be made. `live`, the viewer, may be null; it and `log` outlive them.
  static Result<std::unique_ptr<Observers>> attach(const RunOptions& options, LiveView* live,
                                                   Log& log) {
    auto attached = std::make_unique<Observers>();
    if (options.record) {
      auto recorder = RunRecorder::start(*options.record, log);
      if (!recorder) {
        Error error = std::move(recorder.error());
        if (error.code == ErrorCode::kInvalidArgument) error.code = ErrorCode::kConfig;
        error.where = "--record " + error.where;
        return tl::make_unexpected(std::move(error));
      }
      attached->all_.push_back(std::move(*recorder));
    }
    if (live != nullptr) {
      attached->all_.push_back(
          std::make_unique<ViewFeed>(std::vector<ViewSink*>{&live->sink()}, log));
    }
    return attached;
  }

  [[nodiscard]] bool empty() const noexcept { return all_.empty(); }

  void begin(const ObservedWorld& world) override {
    for (const auto& one : all_) one->begin(world);
  }
  void mapped(const ObservedMap& map) override {
    for (const auto& one : all_) one->mapped(map);
  }
  void stepped(const ObservedStep& step) override {
    for (const auto& one : all_) one->stepped(step);
  }
  void happened(const ObservedEvent& event) override {
    for (const auto& one : all_) one->happened(event);
  }
  void end(const ObservedEnd& end) override {
    for (const auto& one : all_) one->end(end);
  }

 private:
  std::vector<std::unique_ptr<RunObserver>> all_;
};

namespace fs = std::filesystem;

std::string time_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%d-%H%M%S", &local);
  return text;
}

/// Where a run's files go: `wanted`, a folder of each configuration's own below it where there
/// are several, or a new folder below out/.
Result<fs::path> make_out_folder(const std::optional<fs::path>& wanted, const std::string& name,
                                 bool several) {
  std::error_code error;
  fs::path folder;
  if (wanted) {
    folder = several ? *wanted / name : *wanted;
  } else {
    const std::string base = name + "-" + time_stamp();
    folder = fs::path("out") / base;
    for (int n = 2; fs::exists(folder, error); ++n) {
      folder = fs::path("out") / (base + "-" + std::to_string(n));
    }
  }
  fs::create_directories(folder, error);
  if (error) {
    return fail(ErrorCode::kIo, "cannot make the folder: " + error.message(), folder.string());
  }
  return folder;
}

/// The table and the verdict, on stdout.
void print_outcome(const ExperimentOutcome& outcome, const fs::path& folder) {
  std::printf("\n%s\n%s\n\nreport: %s\n", outcome.table.c_str(), outcome.verdict.c_str(),
              (folder / "report.html").c_str());
}

ExitCode wrong_use(std::string message, std::string where, std::string hint) {
  return wrong_input(
      {ErrorCode::kConfig, std::move(message), std::move(where), std::move(hint), nullptr});
}

/// A name that two configurations share; nothing where all differ.
std::optional<std::string> twin_of(const std::vector<std::string>& configurations) {
  std::set<std::string> names;
  for (const std::string& configuration : configurations) {
    const std::string name = fs::path(configuration).stem().string();
    if (!names.insert(name).second) return name;
  }
  return std::nullopt;
}

struct RunResult {
  ExitCode code = ExitCode::kSuccess;
  std::string summary_json;  ///< Empty where there is none: null in the list of several.
};

RunResult refused(const Error& error, Console& console) {
  console.end_progress();
  console.error(error.describe());
  return {exit_code(error), ""};
}

/// "i/n", counted from 1; the whole where there is no such option.
Result<Shard> read_shard(const std::optional<std::string>& text) {
  if (!text) return Shard{};
  int index = 0, count = 0;
  const char* const end = text->data() + text->size();
  const auto first = std::from_chars(text->data(), end, index);
  const bool slash = first.ec == std::errc{} && first.ptr != end && *first.ptr == '/';
  const auto second = slash ? std::from_chars(first.ptr + 1, end, count) : first;
  if (!slash || second.ec != std::errc{} || second.ptr != end || index < 1 || index > count) {
    return fail(ErrorCode::kConfig, "expected i/n with i from 1 to n, e.g. 1/4",
                "--shard " + *text);
  }
  return Shard{index - 1, count};
}

/// Where one of a run's jobs leaves its files.
fs::path shard_folder(const fs::path& run, int index) {
  return run / ("shard-" + std::to_string(index + 1));
}

/// The folder of the run to go on with, or one for a new run.
Result<fs::path> out_folder(const RunOptions& options, const std::string& name) {
  if (!options.resume) {
    return make_out_folder(options.out, name, options.configurations.size() > 1);
  }
  std::error_code ignored;
  const fs::path first = options.jobs > 1 ? shard_folder(*options.resume, 0) : *options.resume;
  if (fs::is_regular_file(first / "results.sqlite", ignored)) return *options.resume;
  return fail(ErrorCode::kConfig, "the folder holds no run to go on with",
              "--resume " + options.resume->string(), "give the folder that a run wrote to");
}

/// Keeps other runs out of a folder for as long as it lives.
class FolderLock {
 public:
  /// Fails with kConfig where another run has the folder.
  static Result<FolderLock> take(const fs::path& folder) {
    FolderLock lock(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock.file_ < 0) {
      return fail(ErrorCode::kIo,
                  "cannot open the folder: " + std::generic_category().message(errno),
                  folder.string());
    }
    // Not every file system has locks.
    if (flock(lock.file_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      return fail(ErrorCode::kConfig, "another run is writing to the folder", folder.string(),
                  "wait for its end, or give another --out");
    }
    return lock;
  }
  ~FolderLock() {
    if (file_ >= 0) close(file_);
  }
  FolderLock(FolderLock&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  FolderLock& operator=(FolderLock&&) = delete;

 private:
  explicit FolderLock(int file) : file_(file) {}
  int file_;
};

/// `live`, the viewer, may be null.
RunResult run_one(const std::string& name, const RunOptions& options, const Shard& shard,
                  LiveView* live, std::stop_token stop) {
  Console console;
  CheckedConfiguration loaded = load_configuration(name, options.overrides, console);
  if (!loaded.errors.empty()) {
    print_errors(loaded.errors);
    std::fprintf(stderr, "%s: %zu error%s\n", name.c_str(), loaded.errors.size(),
                 loaded.errors.size() == 1 ? "" : "s");
    return {exit_code(loaded.errors), ""};
  }
  auto observers = Observers::attach(options, live, console);
  if (!observers) return refused(observers.error(), console);
  const auto folder = out_folder(options, loaded.configuration.name);
  if (!folder) return refused(folder.error(), console);
  const auto lock = FolderLock::take(*folder);
  if (!lock) return refused(lock.error(), console);
  if (auto opened = console.open_file(*folder / "run.log", options.resume.has_value()); !opened) {
    return refused(opened.error(), console);
  }
  console.info("running " + loaded.configuration.file.string() + " into " + folder->string());
  ExperimentContext context{loaded.configuration,
                            loaded.session->host(),
                            console,
                            loaded.session->documents(),
                            *folder,
                            loaded.settings.seed,
                            loaded.settings.threads,
                            std::move(stop),
                            [&](std::int64_t done, std::int64_t total, std::string_view what) {
                              console.progress(done, total, what);
                            },
                            shard,
                            options.resume.has_value(),
                            (*observers)->empty() ? nullptr : observers->get()};
  const auto outcome = run_experiment(context);
  console.end_progress();
  observers->reset();  // A recording is whole before the verdict is told.
  if (!outcome) return refused(outcome.error(), console);
  if (outcome->fault) {
    console.error(outcome->verdict);
  } else {
    console.info(outcome->verdict);
  }
  if (!options.json) print_outcome(*outcome, *folder);
  if (outcome->fault) return {exit_code(*outcome->fault), outcome->summary_json};
  return {outcome->success ? ExitCode::kSuccess : ExitCode::kTaskFailed, outcome->summary_json};
}

/// What each of a run's jobs is asked to do.
std::vector<Job> jobs_of(const std::string& name, const RunOptions& options,
                         const fs::path& folder) {
  std::vector<Job> jobs;
  for (int i = 0; i < options.jobs; ++i) {
    const std::string shard = std::to_string(i + 1) + "/" + std::to_string(options.jobs);
    const fs::path part = shard_folder(folder, i);
    std::error_code ignored;
    const bool has_begun = options.resume && fs::is_regular_file(part / "results.sqlite", ignored);
    Job job{shard, {"run", name, "--shard", shard, has_begun ? "--resume" : "--out", part}};
    for (const std::string& value : options.overrides) {
      job.arguments.insert(job.arguments.end(), {"--set", value});
    }
    jobs.push_back(std::move(job));
  }
  return jobs;
}

/// The same as run_one(), by several processes.
RunResult run_in_jobs(const std::string& name, const RunOptions& options,
                      const std::stop_token& stop) {
  Console console;
  const auto folder = out_folder(options, fs::path(name).stem().string());
  if (!folder) return refused(folder.error(), console);
  const auto lock = FolderLock::take(*folder);
  if (!lock) return refused(lock.error(), console);
  if (auto opened = console.open_file(*folder / "run.log", options.resume.has_value()); !opened) {
    return refused(opened.error(), console);
  }
  const std::vector<JobEnd> ends = run_jobs(jobs_of(name, options, *folder), options.jobs, stop,
                                            [&](const std::string& line) { console.info(line); });
  ExitCode code = ExitCode::kSuccess;
  std::vector<fs::path> parts;
  for (const JobEnd& end : ends) {
    const ExitCode own = end.code ? static_cast<ExitCode>(*end.code) : ExitCode::kFault;
    if (worse(own, ExitCode::kTaskFailed) != ExitCode::kTaskFailed) {
      console.error(shard_folder(*folder, static_cast<int>(parts.size())).string() + ": " +
                    (end.code ? "ended with exit code " + std::to_string(*end.code) : end.fault));
    }
    code = worse(code, own);
    parts.push_back(shard_folder(*folder, static_cast<int>(parts.size())));
  }
  if (code != ExitCode::kSuccess && code != ExitCode::kTaskFailed) return {code, ""};
  Session session(RunSettings{.threads = 1}, &console);
  const auto whole = merge_shards(parts, *folder, session.host());
  if (!whole) return refused(whole.error(), console);
  console.info(whole->verdict);
  if (!options.json) print_outcome(*whole, *folder);
  return {whole->success ? code : worse(code, ExitCode::kTaskFailed), whole->summary_json};
}

}  // namespace

ExitCode run_command(const RunOptions& options) {
  if (const auto twin = twin_of(options.configurations); twin && options.out) {
    return wrong_use(
        "two configurations are named '" + *twin + "': their results would go to the same folder",
        "--out " + options.out->string(), "run them one by one");
  }
  const auto shard = read_shard(options.shard);
  if (!shard) return wrong_input(shard.error());
  if (options.resume && options.configurations.size() > 1) {
    return wrong_use("a run is resumed with its one configuration",
                     "--resume " + options.resume->string(), "resume them one by one");
  }
  if (options.record && options.configurations.size() > 1) {
    return wrong_use("a recording holds the run of one configuration",
                     "--record " + options.record->string(), "run them one by one");
  }
  open_plugins();
  const StopOnSignal stop;
  std::unique_ptr<LiveView> live;
  if (options.view.view) {
    auto started = LiveView::start(options.view, stop.token());
    if (!started) return wrong_input(started.error());
    live = std::move(*started);
  }
  ExitCode code = ExitCode::kSuccess;
  std::string summaries;
  for (const std::string& name : options.configurations) {
    if (stop.token().stop_requested()) {
      code = worse(code, ExitCode::kTaskFailed);
      break;
    }
    const RunResult result = options.jobs > 1
                                 ? run_in_jobs(name, options, stop.token())
                                 : run_one(name, options, *shard, live.get(), stop.token());
    code = worse(code, result.code);
    if (!summaries.empty()) summaries += ",\n";
    summaries += result.summary_json.empty() ? "null" : result.summary_json;
  }
  if (options.json) {
    const bool several = options.configurations.size() > 1;
    std::printf(several ? "[\n%s]\n" : "%s", summaries.c_str());
  }
  return code;
}

}  // namespace sidestep
