// The only source that reads Boost.Beast and Asio: they take a minute to compile.
#include "view_server.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "low_priority.hpp"

namespace sidestep {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace net = boost::asio;
namespace websocket = beast::websocket;
using tcp = net::ip::tcp;
using Bytes = std::shared_ptr<const std::string>;
using Ticket = std::shared_ptr<const int>;  ///< Counts connections by who shares it.

constexpr std::size_t kMostHeaderBytes = 8 << 10;
constexpr std::size_t kMostMessageBytes = 256;
constexpr std::size_t kMostDrainedBytes = 1 << 20;
constexpr int kMostPending = 256;  ///< Messages on their way from the feed to this thread.

std::string_view view(beast::string_view text) noexcept { return {text.data(), text.size()}; }

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? std::string(name.data()) : "";
}

class Client;

/// What all connections share; everything of the server's thread's, but for what says otherwise.
struct Hub {
  Hub(ViewAssets page, ViewServerSettings values, RecordingOpener opener)
      : assets(std::move(page)), settings(std::move(values)), recording(std::move(opener)) {}

  void remove(const std::shared_ptr<Client>& client);
  /// After every change of who is connected, greeted, or wants which slice.
  void update();
  /// Calls `act` with every client that is connected; it may remove itself.
  template <class Act>
  void for_each(const Act& act);

  net::io_context io{1};
  tcp::acceptor acceptor{io};
  net::steady_timer retry{io};
  const ViewAssets assets;
  const ViewServerSettings settings;
  const RecordingOpener recording;
  ViewAddress address;
  Ticket ticket = std::make_shared<const int>(0);
  std::set<std::shared_ptr<Client>> clients;
  bool is_finishing = false;
  std::atomic<int> pending = 0;  ///< [any]

  std::mutex mutex;  ///< Of what follows. [any]
  std::condition_variable_any changed;
  std::size_t connected = 0;
  ViewSink::Demand demand;
  bool is_empty = true;  ///< Nobody is left.
};

/// A page that is connected.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(Hub& hub, tcp::socket socket, Ticket ticket)
      : hub_(hub), ticket_(std::move(ticket)), socket_(std::move(socket)) {
    websocket::stream_base::timeout limits{};
    limits.handshake_timeout = hub_.settings.request_time;
    limits.idle_timeout = hub_.settings.idle_time;
    limits.keep_alive_pings = true;
    socket_.set_option(limits);
    socket_.read_message_max(kMostMessageBytes);
    socket_.auto_fragment(false);
    socket_.binary(true);
  }

  void accept(const http::request<http::empty_body>& request) {
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error || self->is_gone_) return self->leave();
      self->is_connected_ = true;
      self->begin();
    });
  }

  void send(const Bytes& bytes) {
    if (is_gone_ || is_closing_) return;
    if (queued_bytes_ > hub_.settings.max_queued_bytes) return leave();
    queue_.push_back(bytes);
    queued_bytes_ += bytes->size();
    pump();
  }

  void greet(const std::vector<ViewMessage>& messages) {
    if (std::exchange(is_greeted_, true)) return;
    for (const ViewMessage& message : messages) send(message.bytes);
  }

  /// Ends the connection once all is sent.
  void say_goodbye() {
    if (!is_connected_) return leave();
    is_last_ = true;
    pump();
  }

  /// Ends the connection at once.
  void leave() {
    if (std::exchange(is_gone_, true)) return;
    beast::get_lowest_layer(socket_).close();
    hub_.remove(shared_from_this());
  }

  [[nodiscard]] bool is_connected() const noexcept { return is_connected_; }
  [[nodiscard]] bool is_greeted() const noexcept { return is_greeted_; }
  [[nodiscard]] const std::optional<SliceRequest>& slice() const noexcept { return slice_; }

 private:
  void begin() {
    if (hub_.recording) {
      is_greeted_ = true;
      auto opened = hub_.recording();
      if (!opened) return close(websocket::close_code::internal_error);
      recording_ = std::move(*opened);
    }
    hub_.update();
    read();
    pump();
  }

  void read() {
    socket_.async_read(in_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      self->obey();
    });
  }

  void obey() {
    const auto message =
        socket_.got_text()
            ? read_page_message({static_cast<const char*>(in_.cdata().data()), in_.cdata().size()})
            : std::nullopt;
    in_.consume(in_.size());
    if (!message) return close(websocket::close_code::policy_error);
    slice_ = message->slice;
    hub_.update();
    read();
  }

  void refill() {
    if (recording_ == nullptr || !queue_.empty() || is_last_) return;
    auto next = recording_->next();
    if (!next || !*next) {
      recording_ = nullptr;
      return;
    }
    queue_.push_back((*next)->bytes);
    queued_bytes_ += queue_.back()->size();
  }

  void pump() {
    if (is_writing_ || is_closing_ || is_gone_) return;
    refill();
    if (queue_.empty()) {
      if (is_last_) close(websocket::close_code::going_away);
      return;
    }
    is_writing_ = true;
    socket_.async_write(net::buffer(*queue_.front()),
                        [self = shared_from_this()](beast::error_code error, std::size_t) {
                          self->is_writing_ = false;
                          if (error) return self->leave();
                          self->queued_bytes_ -= self->queue_.front()->size();
                          self->queue_.pop_front();
                          self->pump();
                        });
  }

  void close(websocket::close_code code) {
    if (std::exchange(is_closing_, true) || is_gone_) return;
    socket_.async_close(code, [self = shared_from_this()](beast::error_code) { self->leave(); });
  }

  Hub& hub_;
  Ticket ticket_;
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer in_;
  std::deque<Bytes> queue_;  ///< The first is being sent.
  std::size_t queued_bytes_ = 0;
  std::unique_ptr<Recording> recording_;
  std::optional<SliceRequest> slice_;
  bool is_connected_ = false, is_greeted_ = false, is_writing_ = false;
  bool is_last_ = false, is_closing_ = false, is_gone_ = false;
};

void Hub::remove(const std::shared_ptr<Client>& client) {
  clients.erase(client);
  update();
}

void Hub::update() {
  ViewSink::Demand now;
  std::size_t count = 0;
  for (const auto& client : clients) {
    if (!client->is_connected()) continue;
    ++count;
    now.newcomers = now.newcomers || !client->is_greeted();
    const auto& slice = client->slice();
    if (slice && std::ranges::count(now.slices, *slice) == 0) now.slices.push_back(*slice);
  }
  now.any = count > 0;
  {
    const std::lock_guard lock(mutex);
    connected = count;
    demand = std::move(now);
    is_empty = clients.empty();
  }
  changed.notify_all();
}

template <class Act>
void Hub::for_each(const Act& act) {
  const auto all = clients;
  for (const auto& client : all) {
    if (client->is_connected()) act(*client);
  }
}

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
    fields.set(http::field::content_security_policy,
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
    auto token = random_token();
    if (!token) return tl::make_unexpected(token.error());
    hub.address.token = std::move(*token);
  }
  return {};
}

}  // namespace

struct ViewServer::Impl {
  using Hub = sidestep::Hub;

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
                                                      RecordingOpener recording) {
  auto impl = std::make_unique<Impl>(std::move(assets), std::move(settings), std::move(recording));
  if (auto listening = listen(impl->hub); !listening) {
    return tl::make_unexpected(listening.error());
  }
  impl->url = impl->hub.address.url();
  accept_next(impl->hub);
  impl->thread = std::thread([&io = impl->hub.io] {
    lower_thread_priority();
    io.run();
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
  return hub.changed.wait_for(lock, stop, limit, [&] { return hub.connected > 0; });
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
