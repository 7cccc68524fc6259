#include "view_access.hpp"

#include <set>

#include <gtest/gtest.h>

#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using testing_support::TemporaryFolder;

class ViewAccessTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_.write("page/index.html", "page");
    folder_.write("page/viewer.js", "script");
    folder_.write("page/parts/a.css", "style");
    folder_.write("secret.txt", "secret");
    std::filesystem::create_symlink(folder_.path() / "secret.txt",
                                    folder_.path() / "page" / "link.txt");
    auto read = ViewAssets::read(folder_.path() / "page");
    ASSERT_TRUE(read) << read.error().describe();
    assets_ = *read;
  }
  [[nodiscard]] int status(ViewRequest request) const {
    if (request.method.empty()) request.method = "GET";
    return answer(request, address_, assets_).status;
  }
  [[nodiscard]] int status_of_host(std::string_view host) const {
    return status({.target = "/", .host = host});
  }

  TemporaryFolder folder_;
  ViewAssets assets_;
  ViewAddress address_{"127.0.0.1", 8080, std::nullopt, "robot"};
};

TEST_F(ViewAccessTest, ServesTheFilesThatWereThere) {
  folder_.write("page/later.js", "later");
  for (const auto& [path, content] : {std::pair{"/", "page"},
                                      {"/index.html", "page"},
                                      {"/viewer.js", "script"},
                                      {"/viewer.js?version=2", "script"},
                                      {"/parts/a.css", "style"}}) {
    const ViewAnswer found =
        answer({"GET", path, "127.0.0.1:8080", std::nullopt, false, false}, address_, assets_);
    ASSERT_EQ(found.status, 200) << path;
    EXPECT_EQ(found.asset->bytes, content);
  }
  EXPECT_EQ(assets_.find("/viewer.js")->content_type, "text/javascript; charset=utf-8");
  for (const char* path :
       {"", "?", "viewer.js", "/later.js", "/link.txt", "/secret.txt", "/../secret.txt",
        "/parts/../viewer.js", "/%2e%2e/secret.txt", "/..%2fsecret.txt", "//viewer.js", "/parts",
        "/parts/", "/viewer.js/", "/VIEWER.JS", "/viewer.js%00", "/socket/", "http://127.0.0.1/"}) {
    EXPECT_EQ(status({.target = path, .host = "127.0.0.1:8080"}), 404) << path;
  }
  using namespace std::string_view_literals;
  EXPECT_EQ(status({.target = "/viewer.js\0"sv, .host = "127.0.0.1:8080"}), 404);
}

TEST_F(ViewAccessTest, AnswersToItsOwnNamesAlone) {
  for (const char* host : {"127.0.0.1:8080", "localhost:8080", "LocalHost:8080"}) {
    EXPECT_EQ(status_of_host(host), 200) << host;
  }
  for (const char* host :
       {"", "127.0.0.1", "localhost", "127.0.0.1:8081", "evil.example:8080", "robot:8080",
        "127.0.0.1.evil.example:8080", "localhost.:8080", "[::1]:8080", "192.168.1.5:8080"}) {
    EXPECT_EQ(status_of_host(host), 403) << host;
  }
  address_.host = "0.0.0.0";
  for (const char* host : {"192.168.1.5:8080", "[fe80::1]:8080", "ROBOT:8080", "localhost:8080"}) {
    EXPECT_EQ(status_of_host(host), 200) << host;
  }
  for (const char* host : {"evil.example:8080", "1.evil.example:8080", "robot.evil.example:8080"}) {
    EXPECT_EQ(status_of_host(host), 403) << host;
  }
  address_ = {"192.168.1.5", 80, std::nullopt, "robot"};
  EXPECT_EQ(status_of_host("192.168.1.5"), 200);  // browsers leave out port 80
  EXPECT_EQ(status_of_host("192.168.1.6"), 403);
  EXPECT_EQ(status_of_host("localhost"), 403);
  address_.host = "::1";
  EXPECT_EQ(status_of_host("[::1]:80"), 200);
}

TEST_F(ViewAccessTest, SocketIsForItsOwnPage) {
  ViewRequest request{"GET", "/socket", "localhost:8080", std::nullopt, false, true};
  EXPECT_EQ(status(request), 101);
  request.origin = "http://localhost:8080";
  EXPECT_EQ(status(request), 101);
  for (const char* origin :
       {"", "null", "http://127.0.0.1:8080", "http://localhost", "http://localhost:8081",
        "https://localhost:8080", "http://evil.example", "http://localhost:8080.evil.example",
        "http://localhost:8080/"}) {
    request.origin = origin;
    EXPECT_EQ(status(request), 403) << origin;
  }
  request.origin.reset();
  request.is_upgrade = false;
  EXPECT_EQ(status(request), 426);
}

TEST_F(ViewAccessTest, TokenIsRequiredForPageAndSocket) {
  address_.token = "0123456789abcdef";
  const auto page = [&](std::string_view target) {
    return status({.target = target, .host = "127.0.0.1:8080"});
  };
  for (const char* target :
       {"/", "/index.html", "/?token=", "/?token=0123456789abcdee", "/?token=0123456789abcdef0",
        "/?Token=0123456789abcdef", "/?other=0123456789abcdef", "/?xtoken=0123456789abcdef",
        "/?token=wrong&token=0123456789abcdef"}) {
    EXPECT_EQ(page(target), 403) << target;
  }
  EXPECT_EQ(page("/?token=0123456789abcdef"), 200);
  EXPECT_EQ(page("/index.html?a=1&token=0123456789abcdef&b"), 200);
  EXPECT_EQ(page("/viewer.js"), 200);
  ViewRequest socket{"GET", "/socket", "127.0.0.1:8080", "http://127.0.0.1:8080", false, true};
  EXPECT_EQ(status(socket), 403);
  socket.target = "/socket?token=0123456789abcdee";
  EXPECT_EQ(status(socket), 403);
  socket.target = "/socket?token=0123456789abcdef";
  EXPECT_EQ(status(socket), 101);
}

TEST_F(ViewAccessTest, RefusesOtherMethodsAndBodies) {
  ViewRequest request{"HEAD", "/", "127.0.0.1:8080", std::nullopt, false, false};
  EXPECT_EQ(status(request), 200);
  for (const char* method : {"POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "TRACE", "get"}) {
    request.method = method;
    EXPECT_EQ(status(request), 405) << method;
  }
  request.method = "GET";
  request.has_body = true;
  EXPECT_EQ(status(request), 413);
}

TEST_F(ViewAccessTest, UrlIsWhereThePageIs) {
  EXPECT_EQ(address_.url(), "http://127.0.0.1:8080/");
  address_ = {"::1", 81, "abc", "robot"};
  EXPECT_EQ(address_.url(), "http://[::1]:81/?token=abc");
  address_.host = "0.0.0.0";
  EXPECT_EQ(address_.url(), "http://robot:81/?token=abc");
}

TEST(ViewToken, HasOneHundredAndTwentyEightBitsThatDiffer) {
  std::set<std::string> seen;
  for (int i = 0; i < 100; ++i) {
    const auto token = random_token();
    ASSERT_TRUE(token);
    EXPECT_EQ(token->size(), 32U);
    EXPECT_EQ(token->find_first_not_of("0123456789abcdef"), std::string::npos);
    EXPECT_TRUE(seen.insert(*token).second);
  }
}

TEST(ViewToken, ComparisonIsThatOfStrings) {
  for (const char* a : {"", "a", "b", "ab", "ba", "abc"}) {
    for (const char* b : {"", "a", "b", "ab", "ba", "abc"}) {
      EXPECT_EQ(equal_in_constant_time(a, b), std::string(a) == b);
    }
  }
}

TEST(ViewAssetsOfABuild, WithoutAPageSayWhatToDo) {
  const TemporaryFolder folder;
  const auto read = ViewAssets::read(folder.path());
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kNotFound);
  EXPECT_NE(read.error().describe().find("nodejs"), std::string::npos);
}

}  // namespace
}  // namespace sidestep
