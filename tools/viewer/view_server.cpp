#include "view_server.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <exception>
#include <thread>
#include <utility>

#include <boost/asio/post.hpp>

#include <sidestep/core/low_priority.hpp>

#include "detail/view_connection.hpp"

namespace sidestep {
namespace {

using namespace serving;

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? std::string(name.data()) : "";
}

/// Takes a connection in; where there is no room, another one makes it. A crowd that says nothing
/// does not keep a page out.
void take_in(Hub& hub, tcp::socket socket) {
  if (hub.connections.size() + hub.clients.size() >= hub.settings.max_connections) {
    const auto first = std::ranges::min_element(
        hub.connections, [](const auto* a, const auto* b) { return a->yields_before(*b); });
    if (first == hub.connections.end()) return;
    (*first)->give_way();
  }
  std::make_shared<Connection>(hub, std::move(socket))->read();
}

void accept_next(Hub& hub) {
  hub.acceptor.async_accept([&hub](beast::error_code error, tcp::socket socket) {
    if (!hub.acceptor.is_open()) return;
    if (error) {  // e.g. no file descriptors are left
      hub.retry.expires_after(std::chrono::milliseconds(100));
      hub.retry.async_wait([&hub](beast::error_code cancelled) {
        if (!cancelled && hub.acceptor.is_open()) accept_next(hub);
      });
      return;
    }
    try {
      take_in(hub, std::move(socket));
    } catch (const std::exception&) {  // Costs this one.
    }
    accept_next(hub);
  });
}

/// A quarter of the files that the process may open, at most: the run needs the others.
void leave_files_to_the_run(ViewServerSettings& settings) {
  rlimit files{};
  if (getrlimit(RLIMIT_NOFILE, &files) != 0) return;
  const auto quarter = std::max<rlim_t>(files.rlim_cur / 4, 4);
  settings.max_connections = std::min<std::size_t>(settings.max_connections, quarter);
  settings.max_clients = std::min(settings.max_clients, settings.max_connections / 2);
}

/// Until it is stopped. What goes wrong with one connection costs that one.
void serve(net::io_context& io) {
  while (!io.stopped()) {
    try {
      io.run();
    } catch (const std::exception&) {
      continue;
    }
  }
}

tl::unexpected<Error> cannot_serve(const ViewServerSettings& settings, const std::string& why) {
  return fail(ErrorCode::kIo, "the viewer cannot be served: " + why,
              settings.bind + " port " + std::to_string(settings.port),
              "leave out --view-port for a free one");
}

Result<void> listen(Hub& hub) {
  beast::error_code error;
  const auto ip = net::ip::make_address(hub.settings.bind, error);
  if (error) {
    return fail(ErrorCode::kConfig,
                "expected an IP address, e.g. 0.0.0.0 for all of this machine's",
                "--view-bind " + hub.settings.bind);
  }
  const tcp::endpoint endpoint(ip, hub.settings.port);
  hub.acceptor.open(endpoint.protocol(), error);
  if (!error) hub.acceptor.set_option(net::socket_base::reuse_address(true), error);
  if (!error) hub.acceptor.bind(endpoint, error);
  if (!error) hub.acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error) return cannot_serve(hub.settings, error.message());
  hub.address.host = ip.to_string();
  hub.address.port = hub.acceptor.local_endpoint(error).port();
  hub.address.machine = machine_name();
  if (hub.settings.require_token) {
    auto token = SIDESTEP_TRY(random_token());
    hub.address.token = std::move(token);
  }
  return {};
}

}  // namespace

struct ViewServer::Impl {
  Impl(ViewAssets assets, ViewServerSettings settings, RecordingOpener recording)
      : hub(std::move(assets), std::move(settings), std::move(recording)) {}

  /// Lets the server's thread do it.
  template <class Act>
  void post(Act act) {
    ++hub.pending;
    net::post(hub.io, [this, act = std::move(act)] {
      --hub.pending;
      act(hub);
    });
  }

  Hub hub;
  std::string url;
  std::thread thread;
};

ViewServer::ViewServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

ViewServer::~ViewServer() { finish(std::chrono::milliseconds(0)); }

Result<std::unique_ptr<ViewServer>> ViewServer::start(ViewAssets assets,
                                                      ViewServerSettings settings,
                                                      RecordingOpener recording,
                                                      PageRequestHandler* desk) {
  leave_files_to_the_run(settings);
  auto impl = std::make_unique<Impl>(std::move(assets), std::move(settings), std::move(recording));
  SIDESTEP_TRY(listen(impl->hub));
  impl->url = impl->hub.address.url();
  if (desk != nullptr) impl->hub.desk = std::make_unique<DeskWorker>(*desk);
  accept_next(impl->hub);
  impl->thread = std::thread([&io = impl->hub.io] {
    lower_thread_priority();
    serve(io);
  });
  return std::unique_ptr<ViewServer>(new ViewServer(std::move(impl)));
}

const std::string& ViewServer::url() const noexcept { return impl_->url; }

const ViewAddress& ViewServer::address() const noexcept { return impl_->hub.address; }

std::size_t ViewServer::clients() const {
  const std::lock_guard lock(impl_->hub.mutex);
  return impl_->hub.connected;
}

bool ViewServer::wait_for_client(std::chrono::milliseconds limit, const std::stop_token& stop) {
  Hub& hub = impl_->hub;
  std::unique_lock lock(hub.mutex);
  return hub.changed.wait_for(lock, stop, limit, [&] { return hub.was_visited; });
}

void ViewServer::finish(std::chrono::milliseconds limit) {
  if (!impl_->thread.joinable()) return;
  const auto until = std::chrono::steady_clock::now() + limit;
  impl_->post([](Hub& hub) {
    beast::error_code ignored;
    hub.acceptor.close(ignored);
    hub.retry.cancel();
    hub.is_finishing = true;
    const auto all = hub.clients;
    for (const auto& client : all) client->say_goodbye();
  });
  {
    Hub& hub = impl_->hub;
    std::unique_lock lock(hub.mutex);
    hub.changed.wait_until(lock, until, [&] { return hub.is_empty; });
  }
  impl_->hub.io.stop();
  impl_->thread.join();
  impl_->hub.desk = nullptr;
}

ViewSink::Demand ViewServer::demand() {
  Hub& hub = impl_->hub;
  if (hub.pending > kMostPending) return {};  // Catch up first.
  const std::lock_guard lock(hub.mutex);
  return hub.demand;
}

void ViewServer::greet(const std::vector<ViewMessage>& messages) {
  impl_->post([messages](Hub& hub) {
    hub.for_each([&](Client& client) { client.greet(messages); });
    hub.update();
  });
}

void ViewServer::publish(const ViewMessage& message) {
  impl_->post([bytes = message.bytes](Hub& hub) {
    hub.for_each([&](Client& client) {
      if (client.is_greeted()) client.send(bytes);
    });
  });
}

void ViewServer::publish_slice(const SliceRequest& request, const ViewMessage& message) {
  impl_->post([request, bytes = message.bytes](Hub& hub) {
    hub.for_each([&](Client& client) {
      if (client.is_greeted() && client.slice() == request) client.send_slice(bytes);
    });
  });
}

}  // namespace sidestep
