#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep::ros1_node {

/// Where a master is, by ROS_MASTER_URI.
struct MasterAddress {
  std::string host;
  int port = 0;
};

/// Fails with kConfig where `uri` is not http://HOST:PORT.
[[nodiscard]] Result<MasterAddress> parse_master_uri(const std::string& uri);

/// Asks a master again and again whether it is there (its XML-RPC method getPid), and never waits
/// for the answer: roscpp's own question may block for minutes where a network is down. One thread
/// at a time.
class MasterProbe {
 public:
  using SteadyClock = std::chrono::steady_clock;

  /// Fails with kNotFound where the host has no address; looking it up may take its time.
  [[nodiscard]] static Result<MasterProbe> create(const MasterAddress& address, double period_s);
  ~MasterProbe();
  MasterProbe(MasterProbe&& other) noexcept;
  MasterProbe& operator=(MasterProbe&&) = delete;

  /// Goes on with asking as far as that is possible now; to be called at 10 Hz or better.
  void poll();

  /// Since the master last answered; since creation where it never did.
  [[nodiscard]] double silence_s() const;
  [[nodiscard]] bool has_answered() const noexcept { return has_answered_; }

 private:
  enum class State { kIdle, kConnecting, kListening };
  MasterProbe() = default;

  void connect();
  void ask();
  void listen();
  void close();

  std::vector<std::byte> address_;  ///< A sockaddr.
  int family_ = 0;
  std::string question_;
  double period_s_ = 1.0;
  int socket_ = -1;
  State state_ = State::kIdle;
  bool has_answered_ = false;
  SteadyClock::time_point begun_ = SteadyClock::time_point::min();
  SteadyClock::time_point answered_ = SteadyClock::now();
};

}  // namespace sidestep::ros1_node
