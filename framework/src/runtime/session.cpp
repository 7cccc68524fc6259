#include <sidestep/runtime/session.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <string>
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

Session::Session(const RunSettings& settings, Log* log, SdkVersion headers)
    : workers_(settings.threads > 0
                   ? settings.threads
                   : std::max(1, static_cast<int>(std::thread::hardware_concurrency()))),
      host_(HostSettings{host_plugin_paths(settings.plugin_paths, install_layout()),
                         {install_layout().robots},
                         {install_layout().configs / "scenes"},
                         settings.seed},
            log != nullptr ? *log : stderr_log(), clock_, workers_, documents_) {
  // While the major version is 0, a minor version may change everything.
  if (headers.major == kSdkMajor && headers.minor == kSdkMinor) return;
  const auto text = [](int major, int minor) {
    return std::to_string(major) + "." + std::to_string(minor);
  };
  throw std::runtime_error("this program was built with the headers of Sidestep " +
                           text(headers.major, headers.minor) + " and loads the libraries of " +
                           text(kSdkMajor, kSdkMinor) + ": build it anew");
}

}  // namespace sidestep
