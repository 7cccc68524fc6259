#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <string>

#include "commands.hpp"
#include "recorded_view.hpp"

namespace sidestep {
namespace {

constexpr std::chrono::seconds kBrowserTime{20};
constexpr std::chrono::seconds kFlushTime{1};
constexpr std::size_t kMostRequestBytes = std::size_t{256} << 10;  // a thousand spheres

/// Asks the desktop (xdg-open, without a shell) to show a page; tells `log` where it cannot be
/// asked. Does not wait.
void open_browser(const std::string& url, Log& log) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  // Its words are none of a run's; Ctrl-C here is none of its business.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&files, stream, "/dev/null", O_RDWR, 0);
  }
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK);

  std::string program = "xdg-open", argument = url;
  std::array<char*, 3> arguments{program.data(), argument.data(), nullptr};
  pid_t process = 0;
  const int error =
      posix_spawnp(&process, program.c_str(), &files, &attributes, arguments.data(), environ);
  if (error != 0) log.warn("cannot open a browser with xdg-open: " + std::string(strerror(error)));
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
}

}  // namespace

Result<std::unique_ptr<ViewServer>> serve_view(const ViewOptions& options, Log& log,
                                               RecordingOpener recording,
                                               PageRequestHandler* desk) {
  auto assets = SIDESTEP_TRY(
      ViewAssets::read(view_assets_folder(), desk == nullptr ? "index.html" : "spheres.html"));
  ViewServerSettings settings;
  settings.bind = options.bind.value_or(settings.bind);
  settings.require_token = options.bind.has_value();
  settings.port = options.port;
  if (desk != nullptr) settings.max_message_bytes = kMostRequestBytes;
  auto server =
      SIDESTEP_TRY(ViewServer::start(std::move(assets), settings, std::move(recording), desk));
  log.info("viewer: " + server->url());
  if (options.open) open_browser(server->url(), log);
  return server;
}

Result<std::unique_ptr<LiveView>> LiveView::start(const ViewOptions& options,
                                                  const std::stop_token& stop) {
  std::unique_ptr<LiveView> live(new LiveView);
  live->server_ = SIDESTEP_TRY(serve_view(options, live->console_));
  if (options.open && !live->server_->wait_for_client(kBrowserTime, stop)) {
    live->console_.warn("no browser has come; the run begins without");
  }
  return live;
}

LiveView::~LiveView() {
  if (server_ != nullptr) server_->finish(kFlushTime);
}

ExitCode view_command(const std::filesystem::path& file, const ViewOptions& options) {
  const StopOnSignal stop;
  if (const auto opened = open_recording(file); !opened) return wrong_input(opened.error());
  Console console;
  const auto server = serve_view(options, console, [file] { return open_recording(file); });
  if (!server) return wrong_input(server.error());
  console.info("Ctrl-C ends it");
  stop.wait();
  return ExitCode::kSuccess;
}

}  // namespace sidestep
