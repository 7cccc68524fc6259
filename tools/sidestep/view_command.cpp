#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "commands.hpp"
#include "recorded_view.hpp"

namespace sidestep {
namespace {

constexpr std::chrono::seconds kBrowserTime{20};
constexpr std::chrono::seconds kFlushTime{1};
constexpr std::size_t kMostRequestBytes = std::size_t{256} << 10;  // a thousand spheres

/// Asks the desktop (xdg-open, without a shell) to show a page, a URL or a file; tells `log` where
/// it cannot be asked. Does not wait.
void open_browser(const std::string& page, Log& log) {
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

  std::string program = "xdg-open", argument = page;
  std::array<char*, 3> arguments{program.data(), argument.data(), nullptr};
  pid_t process = 0;
  const int error =
      posix_spawnp(&process, program.c_str(), &files, &attributes, arguments.data(), environ);
  if (error != 0) log.warn("cannot open a browser with xdg-open: " + std::string(strerror(error)));
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
}

/// Opens the server's page, by a doorway where the URL holds a token.
std::unique_ptr<Doorway> show(const ViewServer& server, Log& log) {
  if (!server.address().token) {
    open_browser(server.url(), log);
    return nullptr;
  }
  auto doorway = Doorway::make(server.url());
  if (!doorway) {
    log.warn("cannot open a browser: " + doorway.error().describe());
    return nullptr;
  }
  open_browser((*doorway)->file(), log);
  return *std::move(doorway);
}

tl::unexpected<Error> cannot_make(const std::string& file) {
  return fail(ErrorCode::kIo, std::string("cannot make the file: ") + std::strerror(errno), file);
}

}  // namespace

Result<std::unique_ptr<Doorway>> Doorway::make(const std::string& url) {
  const char* const own = std::getenv("XDG_RUNTIME_DIR");
  std::error_code error;
  const bool has_own = own != nullptr && std::filesystem::is_directory(own, error);
  std::string file =
      (has_own ? std::filesystem::path(own) : std::filesystem::temp_directory_path(error)) /
      "sidestep-view-XXXXXX.html";
  const int opened = mkstemps(file.data(), 5);  // readable by this user alone
  if (opened < 0) return cannot_make(file);
  std::unique_ptr<Doorway> doorway(new Doorway(file));
  const std::string page =
      "<!doctype html><meta charset=\"utf-8\"><meta name=\"referrer\" content=\"no-referrer\">"
      "<meta http-equiv=\"refresh\" content=\"0; url=" +
      url + "\"><a href=\"" + url + "\">The viewer</a>\n";
  const bool is_written =
      write(opened, page.data(), page.size()) == static_cast<ssize_t>(page.size());
  if (close(opened) != 0 || !is_written) return cannot_make(file);
  return doorway;
}

Doorway::~Doorway() {
  std::error_code ignored;
  std::filesystem::remove(file_, ignored);
}

Result<ServedView> serve_view(const ViewOptions& options, Log& log, RecordingOpener recording,
                              PageRequestHandler* desk) {
  auto assets = SIDESTEP_TRY(
      ViewAssets::read(view_assets_folder(), desk == nullptr ? "index.html" : "spheres.html"));
  ViewServerSettings settings;
  settings.bind = options.bind.value_or(settings.bind);
  settings.require_token = options.bind.has_value();
  settings.port = options.port;
  if (desk != nullptr) settings.max_message_bytes = kMostRequestBytes;
  ServedView view;
  view.server =
      SIDESTEP_TRY(ViewServer::start(std::move(assets), settings, std::move(recording), desk));
  log.info("viewer: " + view.server->url());
  if (options.open) view.doorway = show(*view.server, log);
  return view;
}

Result<std::unique_ptr<LiveView>> LiveView::start(const ViewOptions& options,
                                                  const std::stop_token& stop) {
  std::unique_ptr<LiveView> live(new LiveView);
  live->view_ = SIDESTEP_TRY(serve_view(options, live->console_));
  if (options.open && !live->view_.server->wait_for_client(kBrowserTime, stop)) {
    live->console_.warn("no browser has come; the run begins without");
  }
  return live;
}

LiveView::~LiveView() {
  if (view_.server != nullptr) view_.server->finish(kFlushTime);
}

ExitCode view_command(const std::filesystem::path& file, const ViewOptions& options) {
  const StopOnSignal stop;
  if (const auto opened = open_recording(file); !opened) return wrong_input(opened.error());
  Console console;
  const auto view = serve_view(options, console, [file] { return open_recording(file); });
  if (!view) return wrong_input(view.error());
  console.info("Ctrl-C ends it");
  stop.wait();
  return ExitCode::kSuccess;
}

}  // namespace sidestep
