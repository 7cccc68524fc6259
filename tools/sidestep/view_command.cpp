#include <condition_variable>
#include <mutex>

#include "commands.hpp"
#include "recorded_view.hpp"
#include "stop_on_signal.hpp"

namespace sidestep {
namespace {

ExitCode wrong_input(const Error& error) {
  print_errors({error});
  return ExitCode::kConfiguration;
}

void wait_for(const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any never;
  std::unique_lock lock(mutex);
  never.wait(lock, stop, [] { return false; });
}

}  // namespace

ExitCode view_command(const std::filesystem::path& file, const ViewOptions& options) {
  const StopOnSignal stop;
  if (const auto opened = open_recording(file); !opened) return wrong_input(opened.error());
  Console console;
  const auto server = serve_view(options, console, [file] { return open_recording(file); });
  if (!server) return wrong_input(server.error());
  console.info("Ctrl-C ends it");
  wait_for(stop.token());
  return ExitCode::kSuccess;
}

}  // namespace sidestep
