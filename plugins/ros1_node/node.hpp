#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>

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

/// The run's clock beside ROS's: which instant of the one is which of the other. While the run's
/// clock stands at its zero, as before a run begins, they drift apart freely; from then on the
/// distance between them follows what both say, and a change beyond the tolerance is a jump. One
/// thread at a time.
class RunTime {
 public:
  explicit RunTime(double jump_tolerance_s) : jump_tolerance_s_(jump_tolerance_s) {}

  /// What both clocks say at one instant. Fails with kInternal, naming both and how far each went,
  /// where one has jumped; and from then on for good.
  [[nodiscard]] Result<void> update(Stamp run, Stamp ros);

  /// After the first update().
  [[nodiscard]] Stamp to_run(Stamp ros) const noexcept { return {ros.ns + offset_ns_}; }
  [[nodiscard]] Stamp to_ros(Stamp run) const noexcept { return {run.ns - offset_ns_}; }

 private:
  struct Reading {
    Stamp run;
    Stamp ros;
  };
  double jump_tolerance_s_;
  std::int64_t offset_ns_ = 0;  ///< Run's minus ROS's.
  std::optional<Reading> last_;
  std::optional<Error> jump_;
};

/// ROS's time. The process is a node of ROS.
[[nodiscard]] Stamp ros_now();

/// Reads both clocks, close together, and updates. Fails likewise, and with kUnsupported where ROS
/// time stands at zero: its parameter use_sim_time is set, and nobody publishes /clock.
[[nodiscard]] Result<void> update(RunTime& time, const Clock& run);

/// Makes this process a node of ROS called `name` and a number, if it is none yet, and returns a
/// probe of the master that has answered. Signals stay the program's own. Fails with kConfig where
/// ROS_MASTER_URI is missing or malformed, with kNotFound where no master answers there within
/// `patience_s`. [main]; waits.
[[nodiscard]] Result<MasterProbe> join_ros(double patience_s, double probe_period_s,
                                           const std::string& name = "sidestep");

}  // namespace sidestep::ros1_node
