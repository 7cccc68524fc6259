#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace sidestep::testing_support {

/// A TCP connection to this machine, and WebSocket (RFC 6455) on it, byte by byte.
class SocketClient {
 public:
  /// `receive_bytes`: of the kernel's buffer; 0 for its own choice.
  explicit SocketClient(unsigned short port, int receive_bytes = 0)
      : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)), port_(port) {
    if (receive_bytes > 0) {
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_bytes, sizeof receive_bytes);
    }
    const timeval patience{120, 0};  // A fault ends the test, not the patience of whoever runs it.
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      close(socket_);
      throw std::runtime_error("cannot connect");
    }
  }
  ~SocketClient() { close(socket_); }
  SocketClient(const SocketClient&) = delete;
  SocketClient& operator=(const SocketClient&) = delete;

  /// False once the other side has gone.
  bool send(std::string_view bytes) {
    while (!bytes.empty()) {
      const ssize_t count = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (count <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
  }
  /// Until the other side ends the connection.
  std::string receive_all() {
    while (receive_more()) {
    }
    return std::move(received_);
  }
  /// So many bytes; what there is where the other side ends before.
  std::string receive(std::size_t count) {
    (void)fill(count);
    return take(count);
  }
  /// An answer's head, with the empty line; what there is where it ends before.
  std::string receive_head() {
    std::size_t end = std::string::npos;
    while ((end = received_.find("\r\n\r\n")) == std::string::npos && receive_more()) {
    }
    return take(end == std::string::npos ? received_.size() : end + 4);
  }

  [[nodiscard]] std::string host() const { return "127.0.0.1:" + std::to_string(port_); }

  /// Asks for the socket; returns the answer's status.
  int ask_for_socket(const std::string& target = "/socket", const std::string& fields = "") {
    send("GET " + target + " HTTP/1.1\r\nHost: " + host() +
         "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
         "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
         fields + "\r\n");
    const std::string head = receive_head();
    const bool upgraded = head.find("s3pPLMBiTxaQ9kYGzzhZRbK+xOo=") != std::string::npos;
    const int status = head.size() > 12 ? std::stoi(head.substr(9, 3)) : 0;
    return status == 101 && !upgraded ? 0 : status;
  }

  struct Frame {
    int opcode = 0;  ///< 1 text, 2 binary, 8 close, 9 ping, 10 pong.
    std::string payload;
    [[nodiscard]] int close_code() const {
      if (payload.size() < 2) return 0;
      return static_cast<unsigned char>(payload[0]) << 8 | static_cast<unsigned char>(payload[1]);
    }
  };
  /// Nothing once the connection has ended.
  std::optional<Frame> receive_frame() {
    if (!fill(2)) return std::nullopt;
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(received_[i]); };
    if ((byte(0) & 0x80) == 0 || (byte(1) & 0x80) != 0) throw std::runtime_error("odd frame");
    std::uint64_t length = byte(1) & 0x7f;
    const std::size_t more = length == 126 ? 2 : length == 127 ? 8 : 0;
    if (!fill(2 + more)) return std::nullopt;
    if (more > 0) length = 0;
    for (std::size_t i = 0; i < more; ++i) length = length << 8 | byte(2 + i);
    Frame frame{byte(0) & 0x0f, ""};
    if (!fill(2 + more + length)) return std::nullopt;
    take(2 + more);
    frame.payload = take(length);
    return frame;
  }
  /// The next binary message's bytes; pings are answered, nothing once the connection has ended.
  std::optional<std::string> receive_message() {
    while (auto frame = receive_frame()) {
      if (frame->opcode == 2) return std::move(frame->payload);
      if (frame->opcode == 9) send_frame(10, frame->payload);
      if (frame->opcode == 8) return std::nullopt;
    }
    return std::nullopt;
  }
  bool send_frame(int opcode, std::string payload) {
    std::string bytes(1, static_cast<char>(0x80 | opcode));
    if (payload.size() < 126) {
      bytes += static_cast<char>(0x80 | payload.size());
    } else {
      bytes += static_cast<char>(0x80 | 126);
      bytes += static_cast<char>(payload.size() >> 8);
      bytes += static_cast<char>(payload.size() & 0xff);
    }
    const std::string mask = "mask";
    for (std::size_t i = 0; i < payload.size(); ++i) {
      payload[i] = static_cast<char>(payload[i] ^ mask[i % 4]);
    }
    return send(bytes + mask + payload);
  }
  bool send_text(std::string text) { return send_frame(1, std::move(text)); }

 private:
  bool receive_more() {
    char buffer[65536];
    const ssize_t count = recv(socket_, buffer, sizeof buffer, 0);
    if (count < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      throw std::runtime_error("nothing came");
    }
    if (count > 0) received_.append(buffer, static_cast<std::size_t>(count));
    return count > 0;
  }
  bool fill(std::size_t count) {
    while (received_.size() < count) {
      if (!receive_more()) return false;
    }
    return true;
  }
  std::string take(std::size_t count) {
    std::string taken = received_.substr(0, count);
    received_.erase(0, count);
    return taken;
  }

  int socket_;
  unsigned short port_;
  std::string received_;
};

}  // namespace sidestep::testing_support
