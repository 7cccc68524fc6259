#include <sys/resource.h>

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server_testing.hpp"
#include "view_server.hpp"

namespace sidestep {
namespace {

using std::chrono::milliseconds;
using testing_support::SocketClient;
using testing_support::ViewServerFixture;

class ViewServerClientsTest : public ViewServerFixture {};

/// A recording of numbered messages.
class NumberedRecording final : public Recording {
 public:
  explicit NumberedRecording(int count) : count_(count) {}
  Result<std::optional<ViewMessage>> next() override {
    if (next_ == count_) return std::nullopt;
    return ViewMessage{
        ViewKind::kState,
        {},
        std::make_shared<const std::string>(std::string(20'000, 'r') + std::to_string(next_++))};
  }

 private:
  int count_;
  int next_ = 0;
};

TEST_F(ViewServerClientsTest, NobodyIsWaitedForBeforeAPageIsConnected) {
  start();
  EXPECT_FALSE(server_->demand().any);
  EXPECT_FALSE(server_->wait_for_client(milliseconds(0), {}));
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(server_->wait_for_client(std::chrono::hours(1), stop.get_token()));
  SocketClient client(port());
  EXPECT_EQ(client.ask_for_socket(), 101);
  EXPECT_TRUE(server_->wait_for_client(std::chrono::hours(1), {}));
  EXPECT_TRUE(server_->demand().any);
}

TEST_F(ViewServerClientsTest, WhoHasLeftAgainHasBeenThere) {
  start();
  { ASSERT_EQ(SocketClient(port()).ask_for_socket(), 101); }
  EXPECT_TRUE(server_->wait_for_client(std::chrono::hours(1), {}));
  while (server_->clients() > 0) std::this_thread::yield();
  EXPECT_TRUE(server_->wait_for_client(milliseconds(0), {}));
}

TEST_F(ViewServerClientsTest, TenPagesGetTheSameMessages) {
  start();
  std::vector<std::unique_ptr<SocketClient>> clients;
  for (int i = 0; i < 10; ++i) clients.push_back(greeted_client({message("hello")}));
  EXPECT_EQ(server_->clients(), 10U);
  std::vector<std::string> sent = {"hello"};
  for (std::size_t i = 0; i < 100; ++i) {
    // Lengths of every kind of frame.
    sent.push_back(std::string(i * 1'000, 'm') + std::to_string(i));
    server_->publish(message(sent.back()));
  }
  for (const auto& client : clients) {
    for (const std::string& expected : sent) ASSERT_EQ(client->receive_message(), expected);
  }
}

TEST_F(ViewServerClientsTest, LateJoinersAreGreetedOnceAndThenGetWhatAllGet) {
  start();
  const auto early = greeted_client({message("world 1")});
  server_->publish(message("a"));
  const auto late = greeted_client({message("world 2"), message("map 2")});
  server_->publish(message("b"));
  for (const char* expected : {"world 1", "a", "b"}) EXPECT_EQ(early->receive_message(), expected);
  for (const char* expected : {"world 2", "map 2", "b"}) {
    EXPECT_EQ(late->receive_message(), expected);
  }
}

TEST_F(ViewServerClientsTest, WhoIsNotGreetedGetsNothingYet) {
  start();
  SocketClient client(port());
  ASSERT_EQ(client.ask_for_socket(), 101);
  while (!server_->demand().newcomers) std::this_thread::yield();
  server_->publish(message("before"));
  server_->greet({message("greeting")});
  EXPECT_EQ(client.receive_message(), "greeting");
}

TEST_F(ViewServerClientsTest, WhoNeverReadsIsDroppedAndOthersGetEverything) {
  ViewServerSettings settings;
  settings.max_queued_bytes = 1 << 20;
  start(settings);
  const auto reader = greeted_client();
  const auto deaf = greeted_client({}, 4096);
  ASSERT_EQ(server_->clients(), 2U);
  int sent = 0;
  while (server_->clients() == 2U && sent < 10'000) {
    const std::string text = std::string(100'000, 'm') + std::to_string(sent++);
    server_->publish(message(text));
    ASSERT_EQ(reader->receive_message(), text);
  }
  EXPECT_EQ(server_->clients(), 1U);
  server_->publish(message("after"));
  EXPECT_EQ(reader->receive_message(), "after");
  int received = 0;
  while (deaf->receive_message()) ++received;
  EXPECT_LT(received, sent) << "it was not waited for";
}

TEST_F(ViewServerClientsTest, ALargeGreetingIsNoReasonToBeDropped) {
  ViewServerSettings settings;
  settings.max_queued_bytes = 1'000;
  start(settings);
  const std::string map(20'000'000, 'm');  // more than the kernel's buffers hold
  const auto client = greeted_client({message("world"), message(map), message("state")}, 4096);
  server_->publish(message("next"));
  for (const std::string& expected : {std::string("world"), map, std::string("state")}) {
    ASSERT_EQ(client->receive_message(), expected);
  }
  EXPECT_EQ(client->receive_message(), "next");
}

TEST_F(ViewServerClientsTest, WhoShowsNoSignOfLifeIsDropped) {
  ViewServerSettings settings;
  settings.idle_time = milliseconds(100);
  start(settings);
  SocketClient dead(port());
  ASSERT_EQ(dead.ask_for_socket(), 101);
  bool was_asked = false;
  while (const auto frame = dead.receive_frame()) was_asked = was_asked || frame->opcode == 9;
  EXPECT_TRUE(was_asked);
}

TEST_F(ViewServerClientsTest, CommandsEndTheConnection) {
  start();
  for (const char* text : {"stop", "{}", R"({"stop": true})", R"({"slice": {"axis": "x"}})",
                           R"({"slice": null, "goal": [0, 0]})"}) {
    const auto client = greeted_client();
    client->send_text(text);
    const auto frame = client->receive_frame();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->opcode, 8) << text;
    EXPECT_EQ(frame->close_code(), 1008) << text;
  }
  const auto binary = greeted_client();
  binary->send_frame(2, R"({"slice": null})");
  EXPECT_EQ(binary->receive_frame().value().close_code(), 1008);
  const auto talker = greeted_client();
  talker->send_text(R"({"slice": null)" + std::string(300, ' ') + "}");
  EXPECT_EQ(talker->receive_frame().value().close_code(), 1009);
  const auto unmasked = greeted_client();
  unmasked->send(std::string("\x81\x02{}", 4));
  EXPECT_EQ(unmasked->receive_frame().value().close_code(), 1002);
}

TEST_F(ViewServerClientsTest, SlicesGoToWhoAsked) {
  start();
  const SliceRequest low{2, 0.5}, across{0, -1.0};
  const auto first = greeted_client(), second = greeted_client(), none = greeted_client();
  first->send_text(R"({"slice": {"axis": "z", "position_m": 0.5}})");
  second->send_text(R"({"slice": {"axis": "x", "position_m": -1}})");
  while (server_->demand().slices.size() < 2) std::this_thread::yield();
  EXPECT_THAT(server_->demand().slices, ::testing::UnorderedElementsAre(low, across));
  server_->publish_slice(low, message("low"));
  server_->publish_slice(across, message("across"));
  server_->publish(message("all"));
  EXPECT_EQ(first->receive_message(), "low");
  EXPECT_EQ(first->receive_message(), "all");
  EXPECT_EQ(second->receive_message(), "across");
  EXPECT_EQ(none->receive_message(), "all");
  first->send_text(R"({"slice": null})");
  while (server_->demand().slices.size() > 1) std::this_thread::yield();
  EXPECT_THAT(server_->demand().slices, ::testing::ElementsAre(across));
}

TEST_F(ViewServerClientsTest, ThereAreAtMostSoManyPages) {
  ViewServerSettings settings;
  settings.max_clients = 2;
  start(settings);
  const auto first = greeted_client();
  auto second = greeted_client();
  EXPECT_EQ(SocketClient(port()).ask_for_socket(), 503);
  second.reset();
  while (server_->clients() == 2U) std::this_thread::yield();
  EXPECT_EQ(SocketClient(port()).ask_for_socket(), 101);
}

TEST_F(ViewServerClientsTest, WhoWaitsLongestGivesWay) {
  ViewServerSettings settings;
  settings.max_connections = 3;
  settings.request_time = std::chrono::hours(1);
  start(settings);
  std::vector<std::unique_ptr<SocketClient>> idle;
  for (int i = 0; i < 20; ++i) idle.push_back(std::make_unique<SocketClient>(port()));
  EXPECT_EQ(status(get("/")), 200);
  for (std::size_t i = 0; i < 18; ++i) EXPECT_EQ(idle[i]->receive_all(), "") << i;
  EXPECT_EQ(SocketClient(port()).ask_for_socket(), 101);
}

TEST_F(ViewServerClientsTest, WhoReadsIsNotCutOffByWhoDoesNot) {
  ViewServerSettings settings;
  settings.max_connections = 50;
  start(settings, {}, nullptr,
        std::string(20'000'000, 'x'));  // more than the kernel's buffers hold
  const std::string request = "GET /viewer.js HTTP/1.1\r\nHost: " + host() + "\r\n\r\n";
  SocketClient reader(port(), 65'536);
  reader.send(request);
  ASSERT_EQ(status(reader.receive_head()), 200);
  std::vector<std::unique_ptr<SocketClient>> deaf;
  for (int i = 0; i < 100; ++i) {
    deaf.push_back(std::make_unique<SocketClient>(port(), 4096));
    deaf.back()->send(request);
    ASSERT_EQ(reader.receive(100'000), std::string(100'000, 'x')) << i;
  }
  EXPECT_EQ(reader.receive_all().size(), 10'000'000U);
}

TEST_F(ViewServerClientsTest, SlicesThatNobodyReadsDoNotAddUp) {
  start();
  const SliceRequest low{2, 0.5};
  const auto deaf = greeted_client({}, 4096);
  deaf->send_text(R"({"slice": {"axis": "z", "position_m": 0.5}})");
  while (server_->demand().slices.empty()) std::this_thread::yield();
  server_->publish(message(std::string(20'000'000, 'm')));  // more than the kernel's buffers hold
  for (int i = 0; i < 100; ++i) server_->publish_slice(low, message("slice " + std::to_string(i)));
  server_->publish(message("after"));
  EXPECT_EQ(deaf->receive_message().value().size(), 20'000'000U);
  EXPECT_EQ(deaf->receive_message(), "slice 0");
  EXPECT_EQ(deaf->receive_message(), "after");
  server_->publish_slice(low, message("next"));
  EXPECT_EQ(deaf->receive_message(), "next");
}

TEST_F(ViewServerClientsTest, FilesAreLeftToTheRun) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit few{64, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  start();
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  std::vector<std::unique_ptr<SocketClient>> pages;
  for (int i = 0; i < 8; ++i) {
    pages.push_back(std::make_unique<SocketClient>(port()));
    ASSERT_EQ(pages.back()->ask_for_socket(), 101) << i;
  }
  EXPECT_EQ(SocketClient(port()).ask_for_socket(), 503);
}

TEST_F(ViewServerClientsTest, GoodbyeComesAfterAllThatIsLeft) {
  start();
  auto client = greeted_client();
  for (int i = 0; i < 50; ++i) server_->publish(message(std::string(100'000, 'm')));
  server_->publish(message("end"));
  std::optional<std::string> last;
  int close_code = 0;
  std::thread page([&] {
    while (const auto frame = client->receive_frame()) {
      if (frame->opcode == 8) {
        close_code = frame->close_code();
        client->send_frame(8, frame->payload);
      } else {
        last = frame->payload;
      }
      if (close_code != 0) break;
    }
    client.reset();
  });
  server_->finish(std::chrono::hours(1));
  page.join();
  EXPECT_EQ(last, "end");
  EXPECT_EQ(close_code, 1001);
}

TEST_F(ViewServerClientsTest, FinishWaitsNoLongerThanItMay) {
  start();
  const auto deaf = greeted_client({}, 4096);
  for (int i = 0; i < 200; ++i) server_->publish(message(std::string(100'000, 'm')));
  server_->finish(milliseconds(0));  // or the test never ends
}

TEST_F(ViewServerClientsTest, RecordingsGoToEachPageFromTheBeginning) {
  start({}, [] {
    return Result<std::unique_ptr<Recording>>(std::make_unique<NumberedRecording>(500));
  });
  SocketClient first(port()), second(port());
  ASSERT_EQ(first.ask_for_socket(), 101);
  const auto expect_all = [](SocketClient& client) {
    for (int i = 0; i < 500; ++i) {
      ASSERT_EQ(client.receive_message(), std::string(20'000, 'r') + std::to_string(i));
    }
  };
  expect_all(first);
  ASSERT_EQ(second.ask_for_socket(), 101);
  expect_all(second);
  EXPECT_EQ(server_->clients(), 2U) << "both may look at it further";
}

TEST_F(ViewServerClientsTest, RecordingThatBreaksOffEndsTheConnection) {
  struct Broken final : Recording {
    Result<std::optional<ViewMessage>> next() override {
      if (std::exchange(read, true)) return fail(ErrorCode::kIo, "broken off");
      return ViewMessage{ViewKind::kState, {}, std::make_shared<const std::string>("first")};
    }
    bool read = false;
  };
  start({}, [] { return Result<std::unique_ptr<Recording>>(std::make_unique<Broken>()); });
  SocketClient client(port());
  ASSERT_EQ(client.ask_for_socket(), 101);
  EXPECT_EQ(client.receive_message(), "first");
  EXPECT_EQ(client.receive_frame().value().close_code(), 1011);
}

TEST_F(ViewServerClientsTest, RecordingsAreReadNoFasterThanThePage) {
  struct Counting final : Recording {
    explicit Counting(std::atomic<int>& count) : read(count) {}
    Result<std::optional<ViewMessage>> next() override {
      ++read;
      return ViewMessage{ViewKind::kState, {}, std::make_shared<const std::string>(100'000, 'r')};
    }
    std::atomic<int>& read;
  };
  std::atomic<int> read = 0;
  start({}, [&] { return Result<std::unique_ptr<Recording>>(std::make_unique<Counting>(read)); });
  {
    SocketClient client(port(), 65'536);
    ASSERT_EQ(client.ask_for_socket(), 101);
    for (int i = 0; i < 1000; ++i) ASSERT_TRUE(client.receive_message());
    // What the kernel's buffers of both sides hold, and no more: they are a few megabytes.
    EXPECT_LT(read, 1000 + 500);
  }
  server_->finish(milliseconds(0));
}

}  // namespace
}  // namespace sidestep
