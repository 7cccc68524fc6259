#include "view_server.hpp"

#include <unistd.h>

#include <array>
#include <exception>
#include <thread>
#include <utility>

#include <boost/asio/post.hpp>

#include <sidestep/core/low_priority.hpp>

#include "detail/view_client.hpp"

namespace sidestep {
namespace {

using namespace serving;

/// A connection until it has been answered, or has become a client.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Hub& hub, tcp::socket socket)
      : hub_(hub), ticket_(hub.ticket), stream_(std::move(socket)) {
    parser_.header_limit(kMostHeaderBytes);
  }

  void read() {
    stream_.expires_after(hub_.settings.request_time);
    http::async_read_header(stream_, in_, parser_,
                            [self = shared_from_this()](beast::error_code error, std::size_t) {
                              self->on_request(error);
                            });
  }

 private:
  void on_request(beast::error_code error) {
    if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      return refuse({431, nullptr, "The request is too long."});
    }
    if (error == http::error::body_limit) {
      return refuse({413, nullptr, "Requests have no body here."});
    }
    if (error == http::error::end_of_stream || error == http::error::partial_message) return;
    if (error && error.category() == make_error_code(http::error::bad_method).category()) {
      return refuse({400, nullptr, "This is no request."});
    }
    if (error) return;  // Too slow, or gone.
    const ViewAnswer reply = answer(request(), hub_.address, hub_.assets);
    if (reply.status == 101) return upgrade();
    if (reply.asset == nullptr) return refuse(reply);
    serve(*reply.asset);
  }

  [[nodiscard]] ViewRequest request() const {
    const auto& message = parser_.get();
    ViewRequest request;
    request.method = view(message.method_string());
    request.target = view(message.target());
    if (message.count(http::field::host) == 1) request.host = view(message[http::field::host]);
    const auto origins = message.count(http::field::origin);
    if (origins == 1) request.origin = view(message[http::field::origin]);
    if (origins > 1) request.origin = "";
    request.has_body = parser_.chunked() || parser_.content_length().value_or(0) > 0;
    request.is_upgrade = websocket::is_upgrade(message) && in_.size() == 0;
    return request;
  }

  void upgrade() {
    if (hub_.is_finishing || hub_.clients.size() >= hub_.settings.max_clients) {
      return refuse({503, nullptr, "There are too many pages already."});
    }
    stream_.expires_never();
    const auto client = std::make_shared<Client>(hub_, stream_.release_socket(), ticket_);
    hub_.clients.insert(client);
    hub_.update();
    client->accept(parser_.get());
  }

  void add_fields(http::fields& fields, std::string_view content_type) const {
    fields.set(http::field::content_type,
               beast::string_view(content_type.data(), content_type.size()));
    fields.set(http::field::cache_control, "no-store");
    fields.set(http::field::connection, "close");
    // Older browsers do not count the page's own socket as 'self'.
    const std::string own_socket = "ws://" + std::string(view(parser_.get()[http::field::host]));
    fields.set("Content-Security-Policy",
               "default-src 'self'; connect-src 'self' " + own_socket +
                   "; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; "
                   "form-action 'none'; frame-ancestors 'none'");
    fields.set("X-Content-Type-Options", "nosniff");
    fields.set("X-Frame-Options", "DENY");
    fields.set("Referrer-Policy", "no-referrer");
    fields.set("Cross-Origin-Resource-Policy", "same-origin");
    fields.set("Cross-Origin-Opener-Policy", "same-origin");
  }

  void serve(const ViewAsset& asset) {
    http::response<http::span_body<const char>> response(http::status::ok, 11);
    add_fields(response, asset.content_type);
    response.content_length(asset.bytes.size());
    if (parser_.get().method() != http::verb::head) {
      response.body() = beast::span<const char>(asset.bytes.data(), asset.bytes.size());
    }
    write(std::move(response));
  }

  void refuse(const ViewAnswer& reply) {
    http::response<http::string_body> response(static_cast<http::status>(reply.status), 11);
    if (reply.status == 403 && parser_.get().count(http::field::host) != 1) {
      parser_.get().set(http::field::host, "");
    }
    add_fields(response, "text/plain; charset=utf-8");
    if (reply.status == 405) response.set(http::field::allow, "GET, HEAD");
    if (reply.status == 426) response.set(http::field::upgrade, "websocket");
    const std::string text = std::string(reply.why) + "\n";
    response.content_length(text.size());
    if (parser_.get().method() != http::verb::head) response.body() = text;
    write(std::move(response));
  }

  template <class Body>
  void write(http::response<Body> response) {
    const auto kept = std::make_shared<http::response<Body>>(std::move(response));
    stream_.expires_after(hub_.settings.idle_time);
    http::async_write(stream_, *kept,
                      [self = shared_from_this(), kept](beast::error_code error, std::size_t) {
                        if (error) return;
                        beast::error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                        self->stream_.expires_after(self->hub_.settings.request_time);
                        self->drain();
                      });
  }

  /// Reads what else comes: a socket that is closed with bytes unread takes the answer with it.
  void drain() {
    stream_.async_read_some(net::buffer(drained_), [self = shared_from_this()](
                                                       beast::error_code error, std::size_t count) {
      self->drained_bytes_ += count;
      if (!error && self->drained_bytes_ < kMostDrainedBytes) self->drain();
    });
  }

  Hub& hub_;
  Ticket ticket_;
  beast::tcp_stream stream_;
  beast::flat_buffer in_{2 * kMostHeaderBytes};
  http::request_parser<http::empty_body> parser_;
  std::array<char, 4096> drained_{};
  std::size_t drained_bytes_ = 0;
};

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? std::string(name.data()) : "";
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
    if (static_cast<std::size_t>(hub.ticket.use_count()) <= hub.settings.max_connections) {
      std::make_shared<Connection>(hub, std::move(socket))->read();
    }
    accept_next(hub);
  });
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
      if (client.is_greeted() && client.slice() == request) client.send(bytes);
    });
  });
}

}  // namespace sidestep
