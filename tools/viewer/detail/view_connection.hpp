#pragma once

// Part of view_server.cpp, which alone includes it.

#include <array>

#include "view_client.hpp"

namespace sidestep::serving {

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

}  // namespace sidestep::serving
