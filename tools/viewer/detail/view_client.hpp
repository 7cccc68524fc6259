#pragma once

// Part of view_server.cpp, which alone includes it: Boost.Beast takes a minute to compile.

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <list>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include <sidestep/core/low_priority.hpp>

#include "view_messages.hpp"
#include "view_server.hpp"

namespace sidestep::serving {

namespace beast = boost::beast;
namespace http = beast::http;
namespace net = boost::asio;
namespace websocket = beast::websocket;
using tcp = net::ip::tcp;
using Bytes = std::shared_ptr<const std::string>;

inline constexpr std::size_t kMostHeaderBytes = 8 << 10;
inline constexpr std::size_t kMostDrainedBytes = 1 << 20;
inline constexpr int kMostPending = 256;  ///< Messages on their way from the feed to this thread.

inline std::string_view view(beast::string_view text) noexcept {
  return {text.data(), text.size()};
}

/// The thread in which a desk answers. Each client has one request under way at most, so that the
/// queue is as long as there are clients.
class DeskWorker {
 public:
  /// Nothing: the page is to be dropped. Called by the worker's thread.
  using Answered = std::function<void(std::optional<std::vector<ViewMessage>>)>;

  explicit DeskWorker(PageRequestHandler& desk) : desk_(desk) {
    net::post(thread_, [] { lower_thread_priority(); });
  }
  ~DeskWorker() { stop_.request_stop(); }

  /// Without a request, for the greeting. [any]
  void ask(std::optional<std::string> request, Answered answered) {
    net::post(thread_, [this, request = std::move(request), answered = std::move(answered)] {
      answered(answer(request));
    });
  }

 private:
  std::optional<std::vector<ViewMessage>> answer(const std::optional<std::string>& request) {
    try {
      if (!request) return desk_.greeting();
      if (const auto message = desk_.answer(*request, stop_.get_token())) return {{*message}};
    } catch (const std::exception&) {  // Costs this page its connection, and nobody else anything.
    }
    return std::nullopt;
  }

  PageRequestHandler& desk_;
  std::stop_source stop_;
  net::thread_pool thread_{1};  ///< Ends first, with what it is at.
};

class Client;
class Connection;

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

  std::list<Connection*> connections;  ///< That are no clients; outlives them, which `io` may hold.
  net::io_context io{1};
  tcp::acceptor acceptor{io};
  net::steady_timer retry{io};
  const ViewAssets assets;
  const ViewServerSettings settings;
  const RecordingOpener recording;
  ViewAddress address;
  std::set<std::shared_ptr<Client>> clients;
  bool is_finishing = false;
  std::unique_ptr<DeskWorker> desk;  ///< Null where pages may ask for slices alone.
  std::atomic<int> pending = 0;      ///< [any]

  std::mutex mutex;  ///< Of what follows. [any]
  std::condition_variable_any changed;
  std::size_t connected = 0;
  ViewSink::Demand demand;
  bool is_empty = true;  ///< Nobody is left.
  bool was_visited = false;
};

/// A page that is connected.
class Client : public std::enable_shared_from_this<Client> {
 public:
  Client(Hub& hub, tcp::socket socket) : hub_(hub), socket_(std::move(socket)) {
    websocket::stream_base::timeout limits{};
    limits.handshake_timeout = hub_.settings.request_time;
    limits.idle_timeout = hub_.settings.idle_time;
    limits.keep_alive_pings = true;
    socket_.set_option(limits);
    socket_.read_message_max(hub_.settings.max_message_bytes);
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
    if (queued_bytes_ > hub_.settings.max_queued_bytes + greeting_bytes_) return leave();
    add(bytes);
    pump();
  }

  /// Left out while the last one has not been taken: each page may want its own, so that what is
  /// not read would add up.
  void send_slice(const Bytes& bytes) {
    const Bytes last = last_slice_.lock();
    if (last != nullptr && std::ranges::count(queue_, last) > 0) return;
    last_slice_ = bytes;
    send(bytes);
  }

  void greet(const std::vector<ViewMessage>& messages) {
    if (std::exchange(is_greeted_, true) || is_gone_ || is_closing_) return;
    for (const ViewMessage& message : messages) add(message.bytes);
    greeting_bytes_ = queued_bytes_;  // A large map is no reason to be dropped.
    pump();
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
    if (hub_.desk != nullptr) {
      is_greeted_ = true;
      return ask(std::nullopt);
    }
    read();
    pump();
  }

  /// The next request is read once this one has been answered.
  void ask(std::optional<std::string> request) {
    hub_.desk->ask(std::move(request), [self = shared_from_this()](auto messages) {
      net::post(self->hub_.io, [self, messages = std::move(messages)] { self->hear(messages); });
    });
  }

  void hear(const std::optional<std::vector<ViewMessage>>& messages) {
    if (is_gone_ || is_closing_) return;
    if (!messages) return close(websocket::close_code::policy_error);
    for (const ViewMessage& message : *messages) send(message.bytes);
    read();
  }

  void read() {
    socket_.async_read(in_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return self->leave();
      self->obey();
    });
  }

  void obey() {
    const std::string text(static_cast<const char*>(in_.cdata().data()), in_.cdata().size());
    in_.consume(in_.size());
    if (hub_.desk != nullptr && socket_.got_text()) return ask(text);
    const auto message = socket_.got_text() ? read_page_message(text) : std::nullopt;
    if (!message) return close(websocket::close_code::policy_error);
    slice_ = message->slice;
    hub_.update();
    read();
  }

  void add(const Bytes& bytes) {
    queue_.push_back(bytes);
    queued_bytes_ += bytes->size();
  }

  void refill() {
    if (recording_ == nullptr || !queue_.empty() || is_last_) return;
    const auto next = recording_->next();
    if (next && *next) {
      const bool is_world = (*next)->kind == ViewKind::kWorld;
      return add(is_world ? recorded_world(**next).bytes : (*next)->bytes);
    }
    recording_ = nullptr;
    if (!next) close(websocket::close_code::internal_error);
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
  websocket::stream<beast::tcp_stream> socket_;
  beast::flat_buffer in_;
  std::deque<Bytes> queue_;  ///< The first is being sent.
  std::weak_ptr<const std::string> last_slice_;
  std::size_t queued_bytes_ = 0;
  std::size_t greeting_bytes_ = 0;
  std::unique_ptr<Recording> recording_;
  std::optional<SliceRequest> slice_;
  bool is_connected_ = false, is_greeted_ = false, is_writing_ = false;
  bool is_last_ = false, is_closing_ = false, is_gone_ = false;
};

inline void Hub::remove(const std::shared_ptr<Client>& client) {
  clients.erase(client);
  update();
}

inline void Hub::update() {
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
    was_visited = was_visited || count > 0;
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

}  // namespace sidestep::serving
