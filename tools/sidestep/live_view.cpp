#include "live_view.hpp"

#include "open_browser.hpp"

namespace sidestep {
namespace {

constexpr std::chrono::seconds kBrowserTime{20};
constexpr std::chrono::seconds kFlushTime{1};
constexpr std::size_t kMostRequestBytes = std::size_t{256} << 10;  // a thousand spheres

}  // namespace

Result<std::unique_ptr<ViewServer>> serve_view(const ViewOptions& options, Log& log,
                                               RecordingOpener recording, PageDesk* desk) {
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

}  // namespace sidestep
