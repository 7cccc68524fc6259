#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

const fs::path kConfigs = fs::path(SIDESTEP_SOURCE_DIR) / "tests" / "integration" / "configs";

/// The ball in the plane with a tray of 0.9 m on it.
class BrokenUrdfTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::copy(fs::path(SIDESTEP_SOURCE_DIR) / "robots" / "planar", folder_.path() / "waiter");
    text_ = read_file(urdf());
  }
  [[nodiscard]] fs::path urdf() const { return folder_.path() / "waiter" / "robot.urdf"; }
  [[nodiscard]] std::string profile() const { return (folder_.path() / "waiter").string(); }
  [[nodiscard]] std::string robot() const { return "{plugin: urdf, profile: " + profile() + "}"; }
  void give_it_a_tray(const std::string& size) const {
    std::string text = text_;
    text.insert(text.rfind("</link>"),
                "  <collision><geometry><box size=\"" + size + "\"/></geometry></collision>\n");
    std::ofstream(urdf()) << text;
  }
  /// Where the box of the tray is.
  [[nodiscard]] std::string line() const {
    const auto end = text_.begin() + static_cast<std::ptrdiff_t>(text_.rfind("</link>"));
    return "robot.urdf:" + std::to_string(1 + std::count(text_.begin(), end, '\n')) + ":";
  }
  void expect_refused(const std::vector<std::string>& command) const {
    const Finished finished = run(command);
    EXPECT_EQ(finished.exit_code, 2) << finished.out;
    EXPECT_THAT(finished.error, HasSubstr(line()));
    EXPECT_THAT(finished.error, HasSubstr("<box> of link 'body' has size=\"0.9 0.9\", expected 3 "
                                          "numbers above 0"));
    EXPECT_THAT(finished.out, Not(HasSubstr("Success")));
  }

  testing_support::TemporaryFolder folder_;
  std::string text_;
};

TEST_F(BrokenUrdfTest, NothingWorksWithATrayThatCannotBeRead) {
  const std::string tiny = (kConfigs / "tiny.yaml").string();
  const std::string set = "robot=" + robot();
  give_it_a_tray("0.9 0.9 0.02");
  EXPECT_EQ(run({"check", tiny, "--set", set}).exit_code, 0);
  EXPECT_EQ(run({"robot", profile()}).exit_code, 0);
  give_it_a_tray("0.9 0.9");
  const std::string out = (folder_.path() / "run").string();
  expect_refused({"run", tiny, "--set", set, "--out", out});
  EXPECT_FALSE(fs::exists(out));
  expect_refused({"robot", profile()});
  expect_refused({"robot", profile(), "--fit", "--protrusion_m", "0.05"});
}

TEST_F(BrokenUrdfTest, CheckRefusesItInEveryExperimentWithARobot) {
  give_it_a_tray("0.9 0.9");
  for (const char* name : {"tiny.yaml", "tiny_deploy.yaml", "tiny_mapping.yaml",
                           "tiny_planners.yaml", "tiny_replan.yaml"}) {
    SCOPED_TRACE(name);
    expect_refused({"check", (kConfigs / name).string(), "--set", "robot=" + robot()});
  }
  expect_refused({"check", (kConfigs / "tiny_study.yaml").string(), "--set",
                  "experiment.robots.0.robot=" + robot()});
}

}  // namespace
}  // namespace sidestep::testing
