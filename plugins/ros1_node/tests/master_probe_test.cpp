#include "node.hpp"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep::ros1_node {
namespace {

using ::testing::HasSubstr;

/// Listens on a loopback port; answers when told to, from the probe's own thread.
class Listener {
 public:
  Listener() : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(socket_, reinterpret_cast<const sockaddr*>(&address), size), 0);
    EXPECT_EQ(listen(socket_, 8), 0);
    EXPECT_EQ(getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~Listener() {
    close(socket_);
    if (asker_ >= 0) close(asker_);
  }

  [[nodiscard]] int port() const { return port_; }

  /// What the asker says, once it has said it; answers it then.
  std::string answer(const std::string& with) {
    if (asker_ < 0) asker_ = accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (asker_ < 0) return {};
    char text[1024];
    const auto count = recv(asker_, text, sizeof text, 0);
    if (count <= 0) return {};
    EXPECT_EQ(send(asker_, with.data(), with.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(with.size()));
    close(asker_);
    asker_ = -1;
    return {text, static_cast<std::size_t>(count)};
  }

 private:
  int socket_;
  int port_ = 0;
  int asker_ = -1;
};

MasterProbe probe_of(int port) {
  constexpr double kPeriod_s = 0.01;
  auto probe = MasterProbe::create({"127.0.0.1", port}, kPeriod_s);
  EXPECT_TRUE(probe) << probe.error().describe();
  return std::move(*probe);
}

TEST(MasterProbe, AsksForTheMastersProcessAndHearsItsAnswer) {
  Listener listener;
  MasterProbe probe = probe_of(listener.port());
  std::string question;
  while (!probe.has_answered()) {
    probe.poll();
    if (question.empty()) question = listener.answer("HTTP/1.0 200 OK\r\n\r\n<methodResponse/>");
  }
  EXPECT_THAT(question, HasSubstr("POST / HTTP/1.0\r\n"));
  EXPECT_THAT(question, HasSubstr("<methodName>getPid</methodName>"));
  const std::size_t body = question.find("\r\n\r\n") + 4;
  EXPECT_THAT(question, HasSubstr("Content-Length: " + std::to_string(question.size() - body)));
}

TEST(MasterProbe, TakesARefusalForNoAnswer) {
  Listener listener;
  MasterProbe probe = probe_of(listener.port());
  std::string question;
  while (question.empty()) {
    probe.poll();
    question = listener.answer("HTTP/1.0 500 Internal Server Error\r\n\r\n");
  }
  const double silence_s = probe.silence_s();
  while (probe.silence_s() < silence_s + 0.02) probe.poll();
  EXPECT_FALSE(probe.has_answered());
}

TEST(MasterProbe, NeverWaitsForOneThatDoesNotAnswer) {
  Listener listener;  // Accepts, and says nothing.
  MasterProbe probe = probe_of(listener.port());
  for (int i = 0; i < 1000; ++i) probe.poll();
  EXPECT_FALSE(probe.has_answered());
}

TEST(MasterProbe, IsSilentWhereNobodyListens) {
  int port = 0;
  {
    Listener gone;
    port = gone.port();
  }
  MasterProbe probe = probe_of(port);
  while (probe.silence_s() < 0.05) probe.poll();
  EXPECT_FALSE(probe.has_answered());
}

TEST(MasterProbe, AsksAgainAndAgain) {
  Listener listener;
  MasterProbe probe = probe_of(listener.port());
  for (int answers = 0; answers < 3;) {
    probe.poll();
    if (!listener.answer("HTTP/1.1 200 OK\r\n\r\n").empty()) ++answers;
  }
  EXPECT_TRUE(probe.has_answered());
}

TEST(MasterUri, IsReadOrRefused) {
  const auto address = parse_master_uri("http://hsrb.local:11311/");
  ASSERT_TRUE(address);
  EXPECT_EQ(address->host, "hsrb.local");
  EXPECT_EQ(address->port, 11311);
  for (const char* wrong : {"", "hsrb:11311", "http://", "http://:11311", "http://hsrb",
                            "http://hsrb:0", "http://hsrb:70000", "http://hsrb:11x"}) {
    const auto refused = parse_master_uri(wrong);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(refused.error().code, ErrorCode::kConfig);
    EXPECT_THAT(refused.error().message, HasSubstr("ROS_MASTER_URI"));
  }
}

}  // namespace
}  // namespace sidestep::ros1_node
