#include "view_message.hpp"

#include <condition_variable>
#include <mutex>

#include "server_testing.hpp"

namespace sidestep {
namespace {

using testing_support::SocketClient;
using testing_support::ViewServerFixture;

/// Greets, echoes, throws, and holds its thread until it is let go.
class EchoDesk final : public PageRequestHandler {
 public:
  std::vector<ViewMessage> greeting() override { return {made("hello")}; }
  std::optional<ViewMessage> answer(std::string_view request,
                                    const std::stop_token& stop) override {
    if (request == "none") return std::nullopt;
    if (request == "throw") throw std::runtime_error("a fault");
    if (request == "hold") {
      std::unique_lock lock(mutex_);
      is_held_ = true;
      changed_.notify_all();
      changed_.wait(lock, stop, [&] { return is_free_; });
    }
    return made("echo " + std::string(request));
  }
  void wait_until_held() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return is_held_; });
  }
  void let_go() {
    {
      const std::lock_guard lock(mutex_);
      is_free_ = true;
    }
    changed_.notify_all();
  }

 private:
  static ViewMessage made(const std::string& text) {
    return {ViewKind::kReply, {}, std::make_shared<const std::string>(text)};
  }
  std::mutex mutex_;
  std::condition_variable_any changed_;
  bool is_held_ = false, is_free_ = false;
};

class PageRequestHandlerTest : public ViewServerFixture {
 protected:
  void TearDown() override { server_ = nullptr; }  // before the desk
  void start_with_desk(ViewServerSettings settings = {}) {
    settings.max_message_bytes = 4096;
    start(settings, {}, &desk_);
  }
  std::unique_ptr<SocketClient> page() {
    auto client = std::make_unique<SocketClient>(port());
    EXPECT_EQ(client->ask_for_socket(), 101);
    EXPECT_EQ(client->receive_message(), "hello");
    return client;
  }
  EchoDesk desk_;
};

TEST_F(PageRequestHandlerTest, EachPageIsGreetedAndAnsweredByItself) {
  start_with_desk();
  const auto a = page(), b = page();
  a->send_text("one");
  b->send_text("two");
  a->send_text("three");  // before the first was answered
  EXPECT_EQ(a->receive_message(), "echo one");
  EXPECT_EQ(a->receive_message(), "echo three");
  EXPECT_EQ(b->receive_message(), "echo two");
}

TEST_F(PageRequestHandlerTest, WhatIsNoRequestOrTooLongEndsTheConnectionOfItsPageAlone) {
  start_with_desk();
  const auto other = page();
  for (const std::string& request :
       {std::string("none"), std::string("throw"), std::string(4097, 'x')}) {
    const auto client = page();
    client->send_text(request);
    EXPECT_FALSE(client->receive_message()) << request.substr(0, 10);
  }
  const auto binary = page();
  binary->send_frame(2, "one");
  EXPECT_FALSE(binary->receive_message());
  other->send_text("still");
  EXPECT_EQ(other->receive_message(), "echo still");
}

TEST_F(PageRequestHandlerTest, ABusyDeskHoldsUpNeitherTheServerNorWhoHasLeft) {
  start_with_desk();
  {
    const auto client = page();
    client->send_text("hold");
    desk_.wait_until_held();
  }
  EXPECT_EQ(status(get("/")), 200);
  SocketClient waiting(port());
  EXPECT_EQ(waiting.ask_for_socket(), 101);
  desk_.let_go();
  EXPECT_EQ(waiting.receive_message(), "hello");
}

TEST_F(PageRequestHandlerTest, AServerEndsThoughItsDeskIsBusy) {
  start_with_desk();
  const auto client = page();
  client->send_text("hold");
  desk_.wait_until_held();
  server_ = nullptr;  // asks the desk to stop
  EXPECT_FALSE(client->receive_message());
}

}  // namespace
}  // namespace sidestep
