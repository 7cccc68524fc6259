#pragma once

// Part of view_server.cpp, which alone includes it, as view_client.hpp.

#include <array>
#include <chrono>
#include <cstdint>
#include <list>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "view_client.hpp"

namespace sidestep::serving {

/// A connection until it has been answered, or has become a client.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Hub& hub, tcp::socket socket) : hub_(hub), stream_(std::move(socket)) {
    parser_.header_limit(kMostHeaderBytes);
    place_ = hub_.connections.insert(hub_.connections.end(), this);
  }
  ~Connection() { leave(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void read() {
    stream_.expires_after(hub_.settings.request_time);
    http::async_read_header(stream_, in_, parser_,
                            [self = shared_from_this()](beast::error_code error, std::size_t) {
                              self->on_request(error);
                            });
  }

  /// Whether this one makes room rather than `other`: who has been answered before who has not yet
  /// asked, that before who still reads its answer, and of those alike who has not moved for
  /// longer.
  [[nodiscard]] bool yields_before(const Connection& other) const noexcept {
    return std::tie(stage_, moved_) < std::tie(other.stage_, other.moved_);
  }
  void give_way() {
    leave();
    stream_.close();
  }

 private:
  enum class Stage : std::uint8_t { kAnswered, kAsking, kReading };

  void reach(Stage stage) {
    stage_ = stage;
    moved_ = Clock::now();
  }
  /// Is none of the hub's connections any more.
  void leave() {
    if (place_) hub_.connections.erase(*place_);
    place_.reset();
  }

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
    const auto client = std::make_shared<Client>(hub_, stream_.release_socket());
    leave();
    hub_.clients.insert(client);
    hub_.update();
    client->accept(parser_.get());
  }

  void add_fields(http::fields& fields, std::string_view content_type,
                  const std::string& policy) const {
    fields.set(http::field::content_type,
               beast::string_view(content_type.data(), content_type.size()));
    fields.set(http::field::cache_control, "no-store");
    fields.set(http::field::connection, "close");
    fields.set("Content-Security-Policy", policy + "; frame-ancestors 'none'");
    fields.set("X-Content-Type-Options", "nosniff");
    fields.set("X-Frame-Options", "DENY");
    fields.set("Referrer-Policy", "no-referrer");
    fields.set("Cross-Origin-Resource-Policy", "same-origin");
    fields.set("Cross-Origin-Opener-Policy", "same-origin");
  }

  void serve(const ViewAsset& asset) {
    http::response<http::span_body<const char>> response(http::status::ok, 11);
    // Older browsers do not count the page's own socket as 'self'.
    const std::string own_socket = "ws://" + std::string(view(parser_.get()[http::field::host]));
    add_fields(response, asset.content_type,
               "default-src 'self'; connect-src 'self' " + own_socket +
                   "; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; "
                   "form-action 'none'");
    response.content_length(asset.bytes.size());
    if (parser_.get().method() != http::verb::head) {
      response.body() = beast::span<const char>(asset.bytes.data(), asset.bytes.size());
    }
    write(std::move(response));
  }

  void refuse(const ViewAnswer& reply) {
    http::response<http::string_body> response(static_cast<http::status>(reply.status), 11);
    add_fields(response, "text/plain; charset=utf-8", "default-src 'none'");
    if (reply.status == 405) response.set(http::field::allow, "GET, HEAD");
    if (reply.status == 426) response.set(http::field::upgrade, "websocket");
    const std::string text = std::string(reply.why) + "\n";
    response.content_length(text.size());
    if (parser_.get().method() != http::verb::head) response.body() = text;
    write(std::move(response));
  }

  template <class Body>
  struct Outgoing {
    explicit Outgoing(http::response<Body> answer) : response(std::move(answer)) {}
    http::response<Body> response;
    http::response_serializer<Body> serializer{response};
  };

  template <class Body>
  void write(http::response<Body> response) {
    stream_.expires_after(hub_.settings.idle_time);
    write_more(std::make_shared<Outgoing<Body>>(std::move(response)));
  }

  template <class Body>
  void write_more(const std::shared_ptr<Outgoing<Body>>& out) {
    reach(Stage::kReading);
    http::async_write_some(stream_, out->serializer,
                           [self = shared_from_this(), out](beast::error_code error, std::size_t) {
                             if (error) return;
                             if (!out->serializer.is_done()) return self->write_more(out);
                             beast::error_code ignored;
                             self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                             self->stream_.expires_after(self->hub_.settings.request_time);
                             self->reach(Stage::kAnswered);
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

  using Clock = std::chrono::steady_clock;

  Hub& hub_;
  std::optional<std::list<Connection*>::iterator> place_;  ///< Among the hub's connections.
  Stage stage_ = Stage::kAsking;
  Clock::time_point moved_ = Clock::now();  ///< When it came, or last took a part of its answer.
  beast::tcp_stream stream_;
  beast::flat_buffer in_{2 * kMostHeaderBytes};
  http::request_parser<http::empty_body> parser_;
  std::array<char, 4096> drained_{};
  std::size_t drained_bytes_ = 0;
};

}  // namespace sidestep::serving
