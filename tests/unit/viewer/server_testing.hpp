#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "socket_client.hpp"
#include "support/temporary_folder.hpp"
#include "view_server.hpp"

namespace sidestep::testing_support {

/// A server of a small page, on a port of the system's choice.
class ViewServerFixture : public ::testing::Test {
 protected:
  void start(const ViewServerSettings& settings = {}, RecordingOpener recording = {},
             PageRequestHandler* desk = nullptr,
             const std::string& script = std::string(300'000, 'x')) {
    folder_.write("page/index.html", "<p>the page</p>");
    folder_.write("page/viewer.js", script);
    folder_.write("secret.txt", "the secret");
    auto assets = ViewAssets::read(folder_.path() / "page");
    ASSERT_TRUE(assets);
    auto server = ViewServer::start(std::move(*assets), settings, std::move(recording), desk);
    ASSERT_TRUE(server) << server.error().describe();
    server_ = std::move(*server);
  }
  [[nodiscard]] unsigned short port() const { return server_->address().port; }
  [[nodiscard]] std::string host() const { return "127.0.0.1:" + std::to_string(port()); }

  /// What one connection gets for these bytes, until the server ends it.
  [[nodiscard]] std::string exchange(const std::string& request) const {
    SocketClient client(port());
    client.send(request);
    return client.receive_all();
  }
  [[nodiscard]] std::string get(const std::string& target, const std::string& fields = "") const {
    return exchange("GET " + target + " HTTP/1.1\r\nHost: " + host() + "\r\n" + fields + "\r\n");
  }
  [[nodiscard]] static int status(const std::string& answer) {
    return answer.size() > 12 ? std::stoi(answer.substr(9, 3)) : 0;
  }

  /// A page whose socket is there and who is greeted, as the feed does.
  std::unique_ptr<SocketClient> greeted_client(const std::vector<ViewMessage>& greeting = {},
                                               int receive_bytes = 0) {
    auto client = std::make_unique<SocketClient>(port(), receive_bytes);
    EXPECT_EQ(client->ask_for_socket(), 101);
    while (!server_->demand().newcomers) std::this_thread::yield();
    server_->greet(greeting);
    while (server_->demand().newcomers) std::this_thread::yield();
    return client;
  }
  [[nodiscard]] static ViewMessage message(const std::string& text) {
    return {ViewKind::kState, {}, std::make_shared<const std::string>(text)};
  }

  TemporaryFolder folder_;
  std::unique_ptr<ViewServer> server_;
};

}  // namespace sidestep::testing_support
