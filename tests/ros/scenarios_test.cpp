// The HSR's four scenarios over ROS 1, in wall-clock time, against a simulated robot that judges
// what it truly touched.

#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "ros_world.hpp"

namespace sidestep::testing {
namespace {

struct RosScenario {
  std::string name;  ///< Of configuration and scene.
  std::vector<std::string> fake_options;
  std::vector<std::string> set;
  double longest_s = 120.0;

  friend void PrintTo(const RosScenario& scenario, std::ostream* out) { *out << scenario.name; }
};

class RosScenarios : public ::testing::TestWithParam<RosScenario> {
 protected:
  RosWorld world_;
};

TEST_P(RosScenarios, ReachTheGoalWithoutTouchingAnything) {
  if (!RosWorld::is_possible()) GTEST_SKIP() << RosWorld::kMissing;
  const RosScenario& scenario = GetParam();
  world_.start(scenario.name, scenario.name, scenario.fake_options, scenario.set);
  const auto code = world_.run().wait(scenario.longest_s);
  const auto truth = world_.end_fake();
  ASSERT_EQ(code, 0) << world_.run().log();
  ASSERT_TRUE(truth.is_object());
  EXPECT_EQ(truth["collisions_true"], 0) << truth.dump(2);
  EXPECT_GT(truth["min_true_clearance_m"], 0.0);
  EXPECT_GT(truth["poses_judged"].get<double>() / truth["duration_s"].get<double>(), 100.0);
  EXPECT_EQ(truth["commands_refused"], 0);
  for (const auto& [joint, speed] : truth["at_end"]["speeds"].items()) {
    // The head may still turn to where it is held.
    if (joint.starts_with("head_")) continue;
    EXPECT_LT(std::abs(speed.get<double>()), 0.02) << joint;
  }
  const auto summary = world_.run_summary();
  ASSERT_TRUE(summary.is_object());
  std::printf(
      "%s: %.1f s; image stamp to trajectory command p50 %.1f ms, p95 %.1f ms; least true "
      "clearance %.3f m\n",
      scenario.name.c_str(), truth["duration_s"].get<double>(),
      summary["stamp_to_trajectory_ms"]["p50"].get<double>(),
      summary["stamp_to_trajectory_ms"]["p95"].get<double>(),
      truth["min_true_clearance_m"].get<double>());
}

std::string name_of(const ::testing::TestParamInfo<RosScenario>& tested) {
  return tested.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    OfTheHsr, RosScenarios,
    ::testing::Values(
        RosScenario{"floor_pickup", {}, {}}, RosScenario{"shelf_pickup", {}, {}},
        // By point clouds.
        RosScenario{"table_pickup",
                    {"--clouds"},
                    {"source.measures=point_cloud",
                     "source.topic=/hsrb/head_rgbd_sensor/depth_registered/rectified_points"}}),
    name_of);

// A minute: run by hand, with --gtest_also_run_disabled_tests.
INSTANTIATE_TEST_SUITE_P(DISABLED_OfTheHsr, RosScenarios,
                         ::testing::Values(RosScenario{"room_navigation", {}, {}, 240.0}), name_of);

}  // namespace
}  // namespace sidestep::testing
