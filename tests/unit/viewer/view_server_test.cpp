#include "view_server.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server_testing.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::SocketClient;
using testing_support::ViewServerFixture;

class ViewServerTest : public ViewServerFixture {};

TEST_F(ViewServerTest, ServesThePageWithStrictHeaders) {
  start();
  EXPECT_EQ(server_->url(), "http://" + host() + "/");
  const std::string page = get("/");
  EXPECT_EQ(status(page), 200);
  EXPECT_THAT(page, ::testing::EndsWith("\r\n\r\n<p>the page</p>"));
  EXPECT_THAT(page, HasSubstr("Content-Type: text/html; charset=utf-8\r\n"));
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy: default-src 'self';"));
  EXPECT_THAT(page, HasSubstr("X-Content-Type-Options: nosniff\r\n"));
  EXPECT_THAT(page, HasSubstr("Cache-Control: no-store\r\n"));
  EXPECT_THAT(page, HasSubstr("Referrer-Policy: no-referrer\r\n"));
  EXPECT_THAT(page, Not(HasSubstr("Access-Control")));
  const std::string script = get("/viewer.js");
  EXPECT_EQ(status(script), 200);
  EXPECT_THAT(script, ::testing::EndsWith("\r\n\r\n" + std::string(300'000, 'x')));
}

TEST_F(ViewServerTest, HeadHasNoBody) {
  start();
  const std::string answer = exchange("HEAD /viewer.js HTTP/1.1\r\nHost: " + host() + "\r\n\r\n");
  EXPECT_EQ(status(answer), 200);
  EXPECT_THAT(answer, HasSubstr("Content-Length: 300000\r\n"));
  EXPECT_THAT(answer, ::testing::EndsWith("\r\n\r\n"));
}

TEST_F(ViewServerTest, NoPathLeadsOutOfThePage) {
  start();
  for (const std::string& target :
       {std::string("/../secret.txt"), std::string("/%2e%2e/secret.txt"),
        std::string("/%2e%2e%2fsecret.txt"), std::string("/..%5csecret.txt"),
        std::string("/./../secret.txt"), std::string("/index.html/../../secret.txt"),
        "/" + (folder_.path() / "secret.txt").string(), (folder_.path() / "secret.txt").string(),
        "file://" + (folder_.path() / "secret.txt").string(), std::string("/secret.txt"),
        std::string("/viewer.js\0/../../secret.txt", 28), std::string("/viewer.js%00"),
        std::string("/nothing")}) {
    const std::string answer = get(target);
    EXPECT_THAT(status(answer), ::testing::AnyOf(400, 404)) << target;
    EXPECT_THAT(answer, Not(HasSubstr("the secret"))) << target;
  }
}

TEST_F(ViewServerTest, RefusesWhatIsNoRequestForAFile) {
  start();
  const std::string fields = " HTTP/1.1\r\nHost: " + host() + "\r\n";
  const std::string post = exchange("POST /" + fields + "Content-Length: 4\r\n\r\nstop");
  EXPECT_EQ(status(post), 405);
  EXPECT_THAT(post, HasSubstr("Allow: GET, HEAD\r\n"));
  EXPECT_EQ(status(exchange("DELETE /index.html" + fields + "\r\n")), 405);
  EXPECT_EQ(status(exchange("GET /" + fields + "Content-Length: 4\r\n\r\nstop")), 413);
  EXPECT_EQ(status(exchange("GET /" + fields + "Transfer-Encoding: chunked\r\n\r\n")), 413);
  EXPECT_EQ(status(exchange("GET /" + fields + "Content-Length: 99999999999\r\n\r\n")), 413);
  EXPECT_EQ(status(exchange("stop the robot\r\n\r\n")), 400);
  EXPECT_EQ(
      status(exchange(std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 15))),
      400);
  EXPECT_EQ(status(get("/socket")), 426);
}

TEST_F(ViewServerTest, AnswersToItsOwnNameAlone) {
  start();
  const auto with_host = [&](const std::string& fields) {
    return status(exchange("GET / HTTP/1.1\r\n" + fields + "\r\n"));
  };
  EXPECT_EQ(with_host("Host: localhost:" + std::to_string(port()) + "\r\n"), 200);
  EXPECT_EQ(with_host("Host: evil.example:" + std::to_string(port()) + "\r\n"), 403);
  EXPECT_EQ(with_host("Host: 127.0.0.1\r\n"), 403);
  EXPECT_EQ(with_host(""), 403);
  EXPECT_THAT(exchange("GET / HTTP/1.1\r\nHost: x; script-src *\r\n\r\n"),
              Not(HasSubstr("script-src")));
  EXPECT_EQ(with_host("Host: " + host() + "\r\nHost: evil.example\r\n"), 403);
}

TEST_F(ViewServerTest, EndsRequestsThatAreTooLong) {
  start();
  const std::string fields = "X-Long: " + std::string(100'000, 'a') + "\r\n";
  EXPECT_EQ(status(get("/", fields)), 431);
  EXPECT_EQ(status(get("/" + std::string(100'000, 'a'))), 431);
  // Without an end: the server does not read on for ever.
  SocketClient client(port());
  client.send("GET / HTTP/1.1\r\n");
  while (client.send(std::string(65'536, 'b'))) {
  }
}

TEST_F(ViewServerTest, EndsConnectionsThatDoNotComeToThePoint) {
  ViewServerSettings settings;
  settings.request_time = std::chrono::milliseconds(50);
  start(settings);
  SocketClient silent(port()), slow(port());
  slow.send("GET / HTTP/1.1\r\nHo");
  EXPECT_EQ(silent.receive_all(), "");
  EXPECT_EQ(slow.receive_all(), "");
}

TEST_F(ViewServerTest, OtherSitesPagesGetNoSocket) {
  start();
  EXPECT_EQ(SocketClient(port()).ask_for_socket(), 101);
  EXPECT_EQ(SocketClient(port()).ask_for_socket("/socket", "Origin: http://" + host() + "\r\n"),
            101);
  for (const char* origin : {"http://evil.example", "null", "http://127.0.0.1"}) {
    EXPECT_EQ(
        SocketClient(port()).ask_for_socket("/socket", "Origin: " + std::string(origin) + "\r\n"),
        403)
        << origin;
  }
}

TEST_F(ViewServerTest, TokenIsRequiredWhereItIsAskedFor) {
  ViewServerSettings settings;
  settings.require_token = true;
  start(settings);
  const std::string mark = "/?token=";
  const std::size_t at = server_->url().find(mark);
  ASSERT_NE(at, std::string::npos);
  const std::string token = server_->url().substr(at + mark.size());
  EXPECT_EQ(token.size(), 32U);
  std::string wrong = token;
  wrong.back() = wrong.back() == '0' ? '1' : '0';
  EXPECT_EQ(status(get("/")), 403);
  EXPECT_EQ(status(get("/?token=" + wrong)), 403);
  EXPECT_EQ(status(get("/?token=" + token)), 200);
  EXPECT_EQ(SocketClient(port()).ask_for_socket("/socket"), 403);
  EXPECT_EQ(SocketClient(port()).ask_for_socket("/socket?token=" + wrong), 403);
  EXPECT_EQ(SocketClient(port()).ask_for_socket("/socket?token=" + token), 101);
}

TEST(ViewServerStart, SaysWhatIsWrong) {
  const testing_support::TemporaryFolder folder;
  folder.write("index.html", "");
  const auto assets = ViewAssets::read(folder.path());
  ASSERT_TRUE(assets);
  const auto first = ViewServer::start(*assets, {});
  ASSERT_TRUE(first);
  ViewServerSettings taken;
  taken.port = (*first)->address().port;
  const auto second = ViewServer::start(*assets, taken);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kIo);
  const auto third = ViewServer::start(*assets, {.bind = "everywhere"});
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().code, ErrorCode::kConfig);
}

}  // namespace
}  // namespace sidestep
