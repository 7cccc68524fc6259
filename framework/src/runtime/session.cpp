#include <sidestep/runtime/session.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

namespace sidestep {

Stamp SteadyWallClock::now() const noexcept {
  return Stamp{std::chrono::duration_cast<std::chrono::nanoseconds>(
                   std::chrono::steady_clock::now().time_since_epoch())
                   .count()};
}

namespace {

class StderrLog final : public Log {
 public:
  void write(LogLevel level, std::string_view message) override {
    if (level < LogLevel::kWarning) return;
    std::fprintf(stderr, "sidestep: %.*s\n", static_cast<int>(message.size()), message.data());
  }
};

Log& stderr_log() {
  static StderrLog log;
  return log;
}

}  // namespace

Session::Session(const RunSettings& settings, Log* log)
    : workers_(settings.threads > 0
                   ? settings.threads
                   : std::max(1, static_cast<int>(std::thread::hardware_concurrency()))),
      host_(HostSettings{host_plugin_paths(settings.plugin_paths, install_layout()),
                         {install_layout().robots},
                         {install_layout().configs / "scenes"},
                         settings.seed},
            log != nullptr ? *log : stderr_log(), clock_, workers_, documents_) {}

}  // namespace sidestep
