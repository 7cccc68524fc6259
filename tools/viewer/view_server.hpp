#pragma once

#include <chrono>
#include <cstddef>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "view_access.hpp"
#include "view_message.hpp"

namespace sidestep {

struct ViewServerSettings {
  std::string bind = "127.0.0.1";  ///< IP address.
  unsigned short port = 0;         ///< 0: the system chooses.
  bool require_token = false;
  std::size_t max_clients = 32;                          ///< Half of max_connections, at most.
  std::size_t max_connections = 128;                     ///< And a quarter of RLIMIT_NOFILE.
  std::size_t max_message_bytes = 256;                   ///< That a client sends.
  std::size_t max_queued_bytes = std::size_t{32} << 20;  ///< Of a client, before it is dropped.
  std::chrono::milliseconds request_time{5'000};         ///< For a whole request.
  std::chrono::milliseconds idle_time{30'000};           ///< Without a sign of life from a client.
};

/// Serves the page and its socket on one port, from a thread of low priority of its own. Nothing
/// that comes in goes any further than here, but for the slices that pages ask for,
/// and what a desk is asked. Who does not
/// read, or sends what is none of its business, is dropped; nobody is waited for.
class ViewServer final : public ViewSink {
 public:
  /// Serves what it is handed as a sink; with `recording`, that to each client from the beginning,
  /// as fast as it reads; with `desk`, which outlives the server, what that answers, to each on its
  /// own. Fails with kConfig for an address that is none, and with kIo where it cannot be bound.
  [[nodiscard]] static Result<std::unique_ptr<ViewServer>> start(
      ViewAssets assets, ViewServerSettings settings, RecordingOpener recording = {},
      PageRequestHandler* desk = nullptr);
  ~ViewServer() override;

  /// Of the page. [any]
  [[nodiscard]] const std::string& url() const noexcept;
  [[nodiscard]] const ViewAddress& address() const noexcept;
  /// How many pages are connected. [any]
  [[nodiscard]] std::size_t clients() const;

  /// Waits until a page has connected, even if it has left again; false where none has in time, or
  /// once stop is requested. [any]
  bool wait_for_client(std::chrono::milliseconds limit, const std::stop_token& stop);

  /// Sends what is left to all that read, says goodbye, and ends. Waits for at most `limit`. [main]
  void finish(std::chrono::milliseconds limit);

  [[nodiscard]] Demand demand() override;
  void greet(const std::vector<ViewMessage>& messages) override;
  void publish(const ViewMessage& message) override;
  void publish_slice(const SliceRequest& request, const ViewMessage& message) override;

 private:
  struct Impl;
  explicit ViewServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
