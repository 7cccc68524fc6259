#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/geometry/shape.hpp>
#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

const std::string kPillar =
    std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny.yaml";
constexpr double kPoleAhead_m = 0.45;
constexpr double kPoleRadius_m = 0.1;

/// The ball around the pillar, with and without something in its way.
class CarryingTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_with(const std::string& attached, const std::string& out) {
    return run({"run", kPillar, "--out", (folder_.path() / out).string(), "--set",
                "optimiser.plugin=gp_chain", "--set", "experiment.slice_heights_m=[0.3]", "--set",
                "experiment.plans.0.attached=" + attached});
  }
  [[nodiscard]] Json plan(const std::string& out) const {
    return Json::parse(read_file(folder_.path() / out / "summary.json"), nullptr, false)
        .at("plans")
        .at(0);
  }
  [[nodiscard]] std::unique_ptr<ResultsReader> results(const std::string& out) const {
    return std::move(*ResultsReader::open(folder_.path() / out / "results.sqlite"));
  }
  /// Least distance from the pole to the pillar of tiny_scene.yaml along a run's trajectory.
  [[nodiscard]] double pole_clearance_m(const std::string& out) const {
    const auto motion = results(out)->array("motion/0", 0, "motion").value().value();
    const Shape pillar = Box{{0.4, 0.4, 1.0}};
    double least_m = INFINITY;
    for (int i = 0; i < motion.rows; ++i) {
      const float* row = motion.values.data() + i * motion.columns;
      const Eigen::Vector3d pole_m(row[2], row[3] + kPoleAhead_m, 0.3);
      const Eigen::Vector3d pillar_m(1.5, 0.0, 0.5);
      least_m = std::min(least_m, signed_distance_m(pillar, pole_m - pillar_m) - kPoleRadius_m);
    }
    return least_m;
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(CarryingTest, PlansForWhatTheRobotCarries) {
  const Finished alone = run_with("[]", "alone");
  ASSERT_EQ(alone.exit_code, 0) << alone.error << alone.out;
  EXPECT_EQ(plan("alone").at("attached"), Json::array());
  EXPECT_LT(pole_clearance_m("alone"), 0.0) << "nothing is to be avoided: the test says nothing";

  const Finished carrying =
      run_with("[{name: pole, link: body, position_m: [0, 0.45, 0.3], spheres: [{radius_m: 0.1}]}]",
               "carrying");
  ASSERT_EQ(carrying.exit_code, 0) << carrying.error << carrying.out;
  EXPECT_EQ(plan("carrying").at("attached"), Json::array({"pole"}));
  EXPECT_GT(pole_clearance_m("carrying"), 0.0);
  EXPECT_THAT(read_file(folder_.path() / "carrying" / "report.html"),
              HasSubstr("The robot carries: pole."));
}

TEST_F(CarryingTest, DrawsWhatTheRobotCarries) {
  (void)run_with(
      "[{name: pole, link: body, position_m: [0, 0.45, 0.3], spheres: [{radius_m: 0.1}]}]",
      "carrying");
  const auto circles = results("carrying")->array("slice/0", 0, "circles").value().value();
  bool is_drawn = false;
  for (int i = 0; i < circles.rows; ++i) {
    const float* circle = circles.values.data() + i * circles.columns;
    const bool is_at_start = circle[3] == 0.0F;
    const double off_m = std::hypot(circle[0] - 0.3, circle[1] - (0.05 + kPoleAhead_m));
    is_drawn |= is_at_start && off_m < 1e-5 && std::abs(circle[2] - kPoleRadius_m) < 0.005;
  }
  EXPECT_TRUE(is_drawn);
}

TEST_F(CarryingTest, RefusesAStartAtWhichItIsInAnObstacle) {
  const Finished finished =
      run_with("[{name: pole, link: body, position_m: [1.0, 0, 0.3], spheres: [{radius_m: 0.1}]}]",
               "blocked");
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(std::string(plan("blocked").at("reason")),
              HasSubstr("the start is not valid: pole is"));
}

TEST_F(CarryingTest, AllowsWhatIsCarriedToTouchWhatItMay) {
  // A skid that reaches below the floor of the true scene, which the map leaves out.
  const std::string skid =
      "[{name: skid, link: body, spheres: [{centre_m: [0, 0, 0.08], "
      "radius_m: 0.1}]}]";
  EXPECT_EQ(run_with(skid, "refused").exit_code, 1);
  EXPECT_THAT(std::string(plan("refused").at("reason")), HasSubstr("in the true scene"));
  const auto allowed = [&](const std::string& link) {
    return run({"run", kPillar, "--out", (folder_.path() / link).string(), "--set",
                "optimiser.plugin=gp_chain", "--set", "experiment.plans.0.attached=" + skid,
                "--set", "check.allowed_contacts=[{link: " + link + ", object: floor}]"});
  };
  const Finished finished = allowed("skid");
  EXPECT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_EQ(allowed("skids").exit_code, 2);
}

}  // namespace
}  // namespace sidestep::testing
