#include "commands.hpp"

#include <pthread.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <mutex>
#include <span>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

/// Signals this soon after the first are the same wish: coreutils' timeout sends one to the process
/// and one to its group.
constexpr std::size_t kMostErrorsShown = 50;
constexpr auto kSameWish = std::chrono::milliseconds(500);

sigset_t handled_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

void wait_for_signals(const std::stop_token& done, const std::stop_source& stop) {
  const sigset_t signals = handled_signals();
  const timespec interval{0, 100'000'000};
  std::chrono::steady_clock::time_point first;
  while (!done.stop_requested()) {
    const int signal = sigtimedwait(&signals, nullptr, &interval);
    if (signal < 0) continue;
    const auto now = std::chrono::steady_clock::now();
    if (stop.request_stop()) first = now;
    if (now - first < kSameWish) continue;
    std::signal(signal, SIG_DFL);
    pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
    std::raise(signal);
  }
}

Result<fs::path> find_configuration(const std::string& name) {
  std::error_code ignored;
  if (fs::is_regular_file(name, ignored)) return fs::path(name);
  const fs::path folder = install_layout().configs;
  for (const fs::path& candidate : {folder / name, folder / (name + ".yaml")}) {
    if (fs::is_regular_file(candidate, ignored)) return candidate;
  }
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  const std::string nearest = nearest_name(fs::path(name).stem().string(), names);
  std::string hint = "neither a file nor a configuration in " + folder.string();
  if (!nearest.empty()) hint += "; did you mean '" + nearest + "'?";
  return fail(ErrorCode::kNotFound, "there is no such configuration", name, hint);
}

}  // namespace

ExitCode exit_code(const Error& error) noexcept {
  switch (error.code) {
    case ErrorCode::kConfig: return ExitCode::kConfiguration;
    case ErrorCode::kPlugin: return ExitCode::kPlugin;
    default: return ExitCode::kFault;
  }
}

ExitCode exit_code(const std::vector<Error>& errors) noexcept {
  const bool only_plugins =
      std::ranges::all_of(errors, [](const Error& e) { return e.code == ErrorCode::kPlugin; });
  return only_plugins ? ExitCode::kPlugin : ExitCode::kConfiguration;
}

ExitCode worse(ExitCode a, ExitCode b) noexcept { return std::max(a, b); }

void print_errors(const std::vector<Error>& errors) {
  const std::size_t shown = std::min(errors.size(), kMostErrorsShown);
  for (const Error& error : std::span(errors).first(shown)) {
    std::fprintf(stderr, "%s\n", error.describe().c_str());
  }
  if (shown < errors.size()) {
    std::fprintf(stderr, "and %zu more mistakes\n", errors.size() - shown);
  }
}

ExitCode wrong_input(const Error& error) {
  print_errors({error});
  return ExitCode::kConfiguration;
}

CheckedConfiguration load_configuration(const std::string& name,
                                        const std::vector<std::string>& overrides, Log& log) {
  CheckedConfiguration loaded;
  const auto file = find_configuration(name);
  if (!file) {
    loaded.errors.push_back(file.error());
    return loaded;
  }
  auto reading = read_configuration(*file, overrides, YamlDocumentReader());
  loaded.configuration = std::move(reading.configuration);
  loaded.errors = std::move(reading.errors);
  if (loaded.configuration.root.entries().empty()) return loaded;  // told why already
  loaded.settings = read_run_settings(loaded.configuration);
  loaded.session = std::make_unique<Session>(loaded.settings, &log);
  for (Error& error : check_configuration(loaded.configuration, loaded.session->host())) {
    loaded.errors.push_back(std::move(error));
  }
  return loaded;
}

void open_plugins() {
  Session session(RunSettings{.threads = 1});
  (void)session.host().plugins();
}

ExitCode check_command(const std::vector<std::string>& configurations,
                       const std::vector<std::string>& overrides) {
  open_plugins();
  ExitCode code = ExitCode::kSuccess;
  for (const std::string& name : configurations) {
    Console console;
    const CheckedConfiguration loaded = load_configuration(name, overrides, console);
    if (loaded.errors.empty()) {
      std::printf("%s: ok\n", name.c_str());
      continue;
    }
    print_errors(loaded.errors);
    std::printf("%s: %zu error%s\n", name.c_str(), loaded.errors.size(),
                loaded.errors.size() == 1 ? "" : "s");
    code = worse(code, exit_code(loaded.errors));
  }
  return code;
}

StopOnSignal::StopOnSignal() {
  const sigset_t signals = handled_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ =
      std::jthread([stop = stop_](const std::stop_token& done) { wait_for_signals(done, stop); });
}

void StopOnSignal::wait() const {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait(lock, token(), [] { return false; });
}

}  // namespace sidestep
