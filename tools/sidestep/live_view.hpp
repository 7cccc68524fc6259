#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "console.hpp"
#include "view_server.hpp"

namespace sidestep {

/// How the viewer is to be served.
struct ViewOptions {
  bool view = false;  ///< Of `run`: whether at all.
  unsigned short port = 0;
  std::optional<std::string> bind;  ///< An address; then a token is required.
  bool open = false;                ///< In a browser.
};

/// Serves the page with what comes through the server, or with a recording; prints its URL, and
/// opens it where that is asked for. With `desk`, the sphere editor's page instead. Fails as
/// ViewAssets::read() and ViewServer::start() do.
[[nodiscard]] Result<std::unique_ptr<ViewServer>> serve_view(const ViewOptions& options, Log& log,
                                                             RecordingOpener recording = {},
                                                             PageDesk* desk = nullptr);

/// The viewer of a command that runs experiments.
class LiveView {
 public:
  /// With a browser to be opened, waits until it has come, for a while.
  [[nodiscard]] static Result<std::unique_ptr<LiveView>> start(const ViewOptions& options,
                                                               const std::stop_token& stop);
  /// Sends what is left, for a second at most.
  ~LiveView();

  /// For the messages of the runs.
  [[nodiscard]] ViewSink& sink() noexcept { return *server_; }

 private:
  LiveView() = default;

  Console console_;
  std::unique_ptr<ViewServer> server_;
};

}  // namespace sidestep
