
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

/// A copy of a profile that comes along.
class RobotCommandTest : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::copy(fs::path(SIDESTEP_SOURCE_DIR) / "robots" / "ur5e", folder_.path() / "ur5e");
    before_ = read_file(profile());
  }
  [[nodiscard]] fs::path profile() const { return folder_.path() / "ur5e" / "profile.yaml"; }
  [[nodiscard]] static Json figures(const Finished& finished) {
    EXPECT_EQ(finished.exit_code, 0) << finished.error;
    return Json::parse(finished.out, nullptr, false);
  }

  testing_support::TemporaryFolder folder_;
  std::string before_;
};

TEST_F(RobotCommandTest, SaysWhatAProfileHas) {
  const Finished table = run({"robot", profile().string()});
  EXPECT_EQ(table.exit_code, 0) << table.error;
  EXPECT_THAT(table.out, HasSubstr("ur5e: 6 planned joints"));
  EXPECT_THAT(table.out, HasSubstr("shoulder_pan_joint"));
  const Json json = figures(run({"robot", profile().string(), "--json"}));
  EXPECT_EQ(json.at("whole").at("spheres"), 31);
  EXPECT_EQ(json.at("whole").at("gap_m"), 0.0);
  EXPECT_EQ(json.at("joints").size(), 6U);
  const Finished mobile = run({"robot", "mobile_panda"});
  EXPECT_THAT(mobile.out, HasSubstr("1 m/s, 1 m/s^2, stops with 2 m/s^2"));
  const Json limits = figures(run({"robot", "mobile_panda", "--json"})).at("limits");
  EXPECT_EQ(limits.at("odom_x"),
            (Json{{"velocity", 1.0}, {"acceleration", 1.0}, {"braking", 2.0}}));
  EXPECT_EQ(limits.at("panda_joint1").at("braking"), 15.0);
  const Json unknown = figures(run({"robot", "hsr", "--json"})).at("limits").at("arm_flex_joint");
  EXPECT_TRUE(unknown.at("acceleration").is_null() && unknown.at("braking").is_null());
}

TEST_F(RobotCommandTest, FitsWithoutWritingUnlessItIsTold) {
  const std::string name = profile().string();
  const Json fit = figures(run({"robot", name, "--fit", "--count", "20", "--json"}));
  EXPECT_LE(fit.at("whole").at("spheres"), 20);
  EXPECT_EQ(fit.at("whole").at("gap_m"), 0.0);
  EXPECT_EQ(read_file(profile()), before_);
  const Json close =
      figures(run({"robot", name, "--fit", "--protrusion_m", "0.06", "--write", "--json"}));
  EXPECT_LE(close.at("whole").at("protrusion_m"), 0.06);
  EXPECT_NE(read_file(profile()), before_);
  EXPECT_EQ(figures(run({"robot", name, "--json"})), close)
      << "what was written is what was fitted";
}

TEST_F(RobotCommandTest, WritesACopyThatLoads) {
  const fs::path out = folder_.path() / "mine.yaml";
  const std::vector<std::string> fit{"robot", profile().string(), "--fit", "--count", "12",
                                     "--out", out.string(),       "--json"};
  const Json written = figures(run(fit));
  EXPECT_EQ(read_file(profile()), before_);
  EXPECT_EQ(figures(run({"robot", out.string(), "--json"})), written);
  EXPECT_EQ(run(fit).exit_code, 4) << "what is there is not overwritten";
}

TEST_F(RobotCommandTest, RefusesWhatItCannotDo) {
  const Finished unknown = run({"robot", "hrs"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.error, HasSubstr("did you mean 'hsr'?"));
  fs::permissions(profile(), fs::perms::owner_read);
  for (const char* act : {"--spheres", "--fit"}) {
    std::vector<std::string> arguments{"robot", profile().string(), act};
    if (act == std::string("--fit")) arguments.emplace_back("--write");
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 4) << act;
    EXPECT_THAT(finished.error, HasSubstr("or use --out FILE"));
  }
  for (const std::vector<std::string>& wrong : {std::vector<std::string>{"--out", "x.yaml"},
                                                {"--count", "3"},
                                                {"--fit", "--count", "3", "--protrusion_m", "0.1"},
                                                {"--fit", "--protrusion_m", "0"},
                                                {"--fit", "--protrusion_m", "nan"},
                                                {"--fit", "--protrusion_m", "-nan"},
                                                {"--fit", "--protrusion_m", "inf"},
                                                {"--fit", "--protrusion_m=-0.1"},
                                                {"--fit", "--protrusion_m", "0.05x"},
                                                {"--fit", "--count", "0"},
                                                {"--fit", "--count=-3"},
                                                {"--fit", "--count", "nan"},
                                                {"--fit", "--count", "2.5"},
                                                {"--fit", "--spheres"},
                                                {"--fit", "--write", "--out", "x.yaml"},
                                                {"--open"}}) {
    std::vector<std::string> arguments{"robot", profile().string()};
    arguments.insert(arguments.end(), wrong.begin(), wrong.end());
    EXPECT_EQ(run(arguments).exit_code, 2) << wrong.front() << ' ' << wrong.back();
  }
  EXPECT_EQ(read_file(profile()), before_);
}

}  // namespace
}  // namespace sidestep::testing
