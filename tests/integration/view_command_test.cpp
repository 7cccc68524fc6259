#include <sys/stat.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"
#include "unit/viewer/decoded_message.hpp"
#include "unit/viewer/socket_client.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing_support::DecodedMessage;
using testing_support::SocketClient;

const std::string kConfigs = std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/";

/// An installation of its own, with a small page or none, and with a browser that tells this test
/// which page it was asked for.
class ViewCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_.path() / "lib" / "sidestep");
    fs::create_directories(folder_.path() / "share" / "sidestep");
    for (const char* library : {RUNTIME_LIBRARY, SDK_LIBRARY}) {
      fs::copy_file(library, folder_.path() / "lib" / fs::path(library).filename());
    }
    fs::create_directory_symlink(PLUGIN_FOLDER, folder_.path() / "lib/sidestep/plugins");
    setenv("LD_LIBRARY_PATH", (folder_.path() / "lib").c_str(), 1);

    asked_ = folder_.path() / "asked";
    ASSERT_EQ(mkfifo(asked_.c_str(), 0600), 0);
    const fs::path browser = folder_.write(
        "bin/xdg-open", "#!/bin/sh\nprintf '%s' \"$1\" > '" + asked_.string() + "'\n");
    fs::permissions(browser, fs::perms::owner_all);
    path_ = std::getenv("PATH");
    setenv("PATH", ((folder_.path() / "bin").string() + ":" + path_).c_str(), 1);
  }
  void TearDown() override {
    setenv("PATH", path_.c_str(), 1);
    unsetenv("LD_LIBRARY_PATH");
  }
  void write_page() { folder_.write("share/sidestep/viewer/index.html", "<p>the page</p>"); }

  /// The URL that the browser is asked for; waits until it is.
  [[nodiscard]] std::string asked_url() const {
    std::ifstream in(asked_);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] static unsigned short port_of(const std::string& url) {
    return static_cast<unsigned short>(std::stoi(url.substr(url.rfind(':') + 1)));
  }
  [[nodiscard]] std::string out() const { return (folder_.path() / "out").string(); }

  testing_support::TemporaryFolder folder_;
  fs::path asked_;
  std::string path_;
};

TEST_F(ViewCommandTest, ShowsARunFromItsBeginningToItsEnd) {
  write_page();
  CommandLine command({"run", kConfigs + "tiny_replan.yaml", "--out", out(), "--view", "--open"});
  const std::string url = asked_url();
  ASSERT_TRUE(url.starts_with("http://127.0.0.1:") && url.ends_with("/")) << url;
  EXPECT_TRUE(command.wait_for("viewer: " + url));
  SocketClient page(port_of(url));
  ASSERT_EQ(page.ask_for_socket(), 101);
  std::vector<std::string> kinds;
  while (const auto bytes = page.receive_message()) kinds.push_back(DecodedMessage(*bytes).kind());
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 0) << finished.error;
  ASSERT_FALSE(kinds.empty());
  EXPECT_EQ(kinds.back(), "end");
  const std::set<std::string> all(kinds.begin(), kinds.end());
  for (const char* kind : {"world", "map", "state", "frame", "plan", "event", "timing"}) {
    EXPECT_TRUE(all.contains(kind)) << kind;
  }
}

TEST_F(ViewCommandTest, RunsAsAlwaysOncePagesHaveLeft) {
  write_page();
  CommandLine command({"run", kConfigs + "tiny.yaml", "--out", out(), "--view", "--open"});
  const unsigned short port = port_of(asked_url());
  { ASSERT_EQ(SocketClient(port).ask_for_socket(), 101); }
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_TRUE(fs::exists(folder_.path() / "out" / "report.html"));
}

TEST_F(ViewCommandTest, AnAddressOfOnesOwnNeedsAToken) {
  write_page();
  CommandLine command({"run", kConfigs + "tiny.yaml", "--out", out(), "--view", "--open",
                       "--view-bind", "127.0.0.1"});
  // Command lines are for all to see: the browser is asked for a file of this user's alone.
  const fs::path doorway = asked_url();
  ASSERT_EQ(fs::status(doorway).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  std::ifstream in(doorway);
  const std::string page{std::istreambuf_iterator<char>(in), {}};
  const std::size_t begin = page.find("url=") + 4;
  const std::string url = page.substr(begin, page.find('"', begin) - begin);
  const std::size_t mark = url.find("?token=");
  ASSERT_NE(mark, std::string::npos) << url;
  const unsigned short port = port_of(url);
  EXPECT_EQ(SocketClient(port).ask_for_socket("/socket"), 403);
  EXPECT_EQ(SocketClient(port).ask_for_socket("/socket" + url.substr(mark)), 101);
  EXPECT_EQ(command.wait().exit_code, 0);
  EXPECT_FALSE(fs::exists(doorway));
}

TEST_F(ViewCommandTest, WithoutAPageSaysHowToGetOne) {
  const Finished finished = run({"run", kConfigs + "tiny.yaml", "--out", out(), "--view"});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("this build of Sidestep has no viewer's page"));
  EXPECT_THAT(finished.error, HasSubstr("install nodejs and npm"));
  EXPECT_FALSE(fs::exists(out()));
}

TEST_F(ViewCommandTest, RefusesWhatDoesNotFitTogether) {
  write_page();
  const std::string tiny = kConfigs + "tiny.yaml";
  EXPECT_EQ(run({"run", tiny, "--view", "--jobs", "2"}).exit_code, 2);
  EXPECT_EQ(run({"run", tiny, "--view-port", "8080"}).exit_code, 2);
  EXPECT_EQ(run({"run", tiny, "--view", "--view-port", "0"}).exit_code, 2);
  const Finished address = run({"run", tiny, "--view", "--view-bind", "everywhere"});
  EXPECT_EQ(address.exit_code, 2);
  EXPECT_THAT(address.error, HasSubstr("--view-bind everywhere"));
  const Finished missing = run({"view", (folder_.path() / "nothing.bag").string()});
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.error, HasSubstr("nothing.bag"));
}

}  // namespace
}  // namespace sidestep::testing
