#include "node.hpp"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <utility>

#include <ros/init.h>
#include <ros/time.h>

#include <sidestep/core/format.hpp>

#include "conversions.hpp"

namespace sidestep::ros1_node {
namespace {

/// One that does not answer for so long is asked anew.
constexpr double kGiveUp_s = 1.0;

std::string question(const MasterAddress& address) {
  const std::string body =
      "<?xml version=\"1.0\"?><methodCall><methodName>getPid</methodName><params><param><value>"
      "<string>/sidestep</string></value></param></params></methodCall>";
  return "POST / HTTP/1.0\r\nHost: " + address.host + ":" + std::to_string(address.port) +
         "\r\nContent-Type: text/xml\r\nContent-Length: " + std::to_string(body.size()) +
         "\r\n\r\n" + body;
}

bool is_ready(int socket, short events) {
  pollfd wanted{socket, events, 0};
  return ::poll(&wanted, 1, 0) > 0;
}

double seconds_since(MasterProbe::SteadyClock::time_point then) {
  return std::chrono::duration<double>(MasterProbe::SteadyClock::now() - then).count();
}

std::string seconds_text(std::int64_t ns) {
  return format("%.3f s", 1e-9 * static_cast<double>(ns));
}

}  // namespace

Stamp ros_now() { return ros_messages::to_stamp(::ros::Time::now()); }

Result<MasterAddress> parse_master_uri(const std::string& uri) {
  const auto bad = [&] {
    return fail(ErrorCode::kConfig, "ROS_MASTER_URI is '" + uri + "', not http://HOST:PORT",
                "environment");
  };
  constexpr std::string_view kScheme = "http://";
  if (!uri.starts_with(kScheme)) return bad();
  const std::size_t colon = uri.rfind(':');
  if (colon <= kScheme.size()) return bad();
  MasterAddress address;
  address.host = uri.substr(kScheme.size(), colon - kScheme.size());
  const char* const end = uri.data() + uri.size();
  const auto [rest, fault] = std::from_chars(uri.data() + colon + 1, end, address.port);
  const bool is_whole = rest == end || (rest + 1 == end && *rest == '/');
  if (fault != std::errc() || !is_whole || address.port < 1 || address.port > 65535) return bad();
  return address;
}

Result<MasterProbe> MasterProbe::create(const MasterAddress& address, double period_s) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_family = AF_INET;  // As roscpp, unless it is told otherwise.
  addrinfo* found = nullptr;
  const int fault =
      ::getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found);
  if (fault != 0) {
    return fail(ErrorCode::kNotFound,
                "the host of ROS_MASTER_URI, '" + address.host +
                    "', has no address: " + ::gai_strerror(fault),
                "environment");
  }
  MasterProbe probe;
  const auto* bytes = reinterpret_cast<const std::byte*>(found->ai_addr);
  probe.address_.assign(bytes, bytes + found->ai_addrlen);
  probe.family_ = found->ai_family;
  ::freeaddrinfo(found);
  probe.question_ = question(address);
  probe.period_s_ = period_s;
  return probe;
}

MasterProbe::MasterProbe(MasterProbe&& other) noexcept
    : address_(std::move(other.address_)),
      family_(other.family_),
      question_(std::move(other.question_)),
      period_s_(other.period_s_),
      socket_(std::exchange(other.socket_, -1)),
      state_(std::exchange(other.state_, State::kIdle)),
      has_answered_(other.has_answered_),
      begun_(other.begun_),
      answered_(other.answered_) {}

MasterProbe::~MasterProbe() { close(); }

void MasterProbe::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  state_ = State::kIdle;
}

double MasterProbe::silence_s() const { return seconds_since(answered_); }

void MasterProbe::poll() {
  const bool never = begun_ == SteadyClock::time_point::min();
  if (state_ != State::kIdle && seconds_since(begun_) > kGiveUp_s) close();
  if (state_ == State::kIdle && (never || seconds_since(begun_) >= period_s_)) connect();
  if (state_ == State::kConnecting) ask();
  if (state_ == State::kListening) listen();
}

void MasterProbe::connect() {
  begun_ = SteadyClock::now();
  socket_ = ::socket(family_, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket_ < 0) return;
  const int done = ::connect(socket_, reinterpret_cast<const sockaddr*>(address_.data()),
                             static_cast<socklen_t>(address_.size()));
  if (done == 0 || errno == EINPROGRESS) {
    state_ = State::kConnecting;
  } else {
    close();
  }
}

void MasterProbe::ask() {
  if (!is_ready(socket_, POLLOUT)) return;
  // A question of 250 bytes fits into the buffer of a new connection.
  const auto sent = ::send(socket_, question_.data(), question_.size(), MSG_NOSIGNAL);
  if (sent == static_cast<ssize_t>(question_.size())) {
    state_ = State::kListening;
  } else {
    close();
  }
}

void MasterProbe::listen() {
  if (!is_ready(socket_, POLLIN)) return;
  std::array<char, 16> begin{};
  const auto read = ::recv(socket_, begin.data(), begin.size(), 0);
  // "HTTP/1.0 200 OK"
  const std::string_view text(begin.data(), read > 0 ? static_cast<std::size_t>(read) : 0);
  if (text.starts_with("HTTP/") && text.find(" 200") != std::string_view::npos) {
    has_answered_ = true;
    answered_ = SteadyClock::now();
  }
  close();
}

Result<void> RunTime::update(Stamp run, Stamp ros) {
  if (jump_) return tl::make_unexpected(*jump_);
  const std::int64_t offset_ns = run.ns - ros.ns;
  const bool was_standing = !last_ || last_->run.ns <= 0;
  const auto tolerance_ns = Stamp::from_seconds(jump_tolerance_s_).ns;
  if (!was_standing && std::abs(offset_ns - offset_ns_) > tolerance_ns) {
    jump_ =
        Error{ErrorCode::kInternal,
              "ROS time jumped against the run's clock: it went on by " +
                  seconds_text(ros.ns - last_->ros.ns) + " to " + seconds_text(ros.ns) +
                  " while the run's clock went on by " + seconds_text(run.ns - last_->run.ns) +
                  " to " + seconds_text(run.ns),
              "clock", "let the machines' clocks settle before a run (chrony, not steps)", nullptr};
    return tl::make_unexpected(*jump_);
  }
  offset_ns_ = offset_ns;
  last_ = Reading{run, ros};
  return {};
}

Result<void> update(RunTime& time, const Clock& run) {
  constexpr int kTries = 3;
  constexpr std::int64_t kClose_ns = 200'000;
  Stamp middle, ros;
  for (int i = 0; i < kTries; ++i) {
    const Stamp before = run.now();
    ros = ros_now();
    const Stamp after = run.now();
    middle = {before.ns + (after.ns - before.ns) / 2};
    if (after.ns - before.ns <= kClose_ns) break;
  }
  if (ros.ns == 0) {
    return fail(ErrorCode::kUnsupported,
                "ROS time stands at zero: /use_sim_time is set, and nobody publishes /clock",
                "clock", "rosparam set /use_sim_time false");
  }
  return time.update(middle, ros);
}

Result<MasterProbe> join_ros(double patience_s, double probe_period_s, const std::string& name) {
  const char* const uri = std::getenv("ROS_MASTER_URI");
  if (uri == nullptr) {
    return fail(ErrorCode::kConfig, "ROS_MASTER_URI is not set", "environment",
                "export ROS_MASTER_URI=http://ROBOT:11311");
  }
  const auto address = SIDESTEP_TRY(parse_master_uri(uri));
  auto probe = SIDESTEP_TRY(MasterProbe::create(address, probe_period_s));
  while (!probe.has_answered() && probe.silence_s() < patience_s) {
    probe.poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (!probe.has_answered()) {
    return fail(ErrorCode::kNotFound, std::string("no ROS master answers at ROS_MASTER_URI=") + uri,
                "environment", "start the robot or a rosmaster, or export another ROS_MASTER_URI");
  }
  if (!::ros::isInitialized()) {
    ::ros::init(::ros::M_string(), name,
                ::ros::init_options::NoSigintHandler | ::ros::init_options::AnonymousName);
  }
  // Started here, ROS is not shut down with the last handle of one plugin.
  if (!::ros::isStarted()) ::ros::start();
  // With use_sim_time there is none before the first message on /clock.
  (void)::ros::Time::waitForValid(::ros::WallDuration(patience_s));
  return probe;
}

}  // namespace sidestep::ros1_node
