#include "../viewpoint.hpp"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hsr_on_its_way.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::simulator {
namespace {

using ::testing::HasSubstr;

class MountedHead : public ::testing::Test {
 protected:
  MountedHead() { hsr_.move(hsr_.pose("go"), Eigen::VectorXd::Zero(8), 0.0, 10.0); }

  MountedCamera make() {
    auto made = MountedCamera::create(mount_, hsr_.context());
    if (!made) throw std::runtime_error(made.error().describe());
    return std::move(*made);
  }
  static Eigen::Vector3d axis(const View& view) { return view.T_world_camera.linear().col(2); }

  testing::HsrOnItsWay hsr_;
  MountOptions mount_{.link = "head_rgbd_sensor_link"};
};

TEST_F(MountedHead, RestsAsTheProfileHasItWhereNobodyTurnsIt) {
  MountedCamera camera = make();
  for (const double t : {0.0, 3.0, 9.0}) {
    const auto view = camera.view(Stamp::from_seconds(t));
    EXPECT_NEAR((axis(*view) - Eigen::Vector3d(std::cos(0.3), 0.0, -std::sin(0.3))).norm(), 0.0,
                1e-9);
  }
}

TEST_F(MountedHead, IsWhereTheRobotsHeadWasAtTheFramesStamp) {
  hsr_.motion().record_head({0.0, -0.3}, Stamp::from_seconds(0.0));
  hsr_.motion().record_head({1.0, -0.7}, Stamp::from_seconds(2.0));
  MountedCamera camera = make();
  for (const double t : {0.0, 0.5, 1.7, 2.0, 4.0}) {
    const double share = std::min(1.0, t / 2.0);
    const double pan_rad = share, tilt_rad = -0.3 - 0.4 * share;
    const Eigen::Vector3d expected(std::cos(tilt_rad) * std::cos(pan_rad),
                                   std::cos(tilt_rad) * std::sin(pan_rad), std::sin(tilt_rad));
    EXPECT_LT((axis(*camera.view(Stamp::from_seconds(t))) - expected).norm(), 1e-9) << t;
  }
}

TEST_F(MountedHead, TakesTheRobotsHeadWithIt) {
  hsr_.motion().record_head({0.0, -0.3}, Stamp::from_seconds(0.0));
  hsr_.motion().record_head({1.0, -0.3}, Stamp::from_seconds(1.0));
  MountedCamera camera = make();
  const auto before = camera.view(Stamp::from_seconds(0.0));
  const auto after = camera.view(Stamp::from_seconds(2.0));
  ASSERT_EQ(after->T_world_shape.size(), camera.robot().shapes().size());
  for (std::size_t i = 0; i < camera.robot().shapes().size(); ++i) {
    const std::string name = camera.robot().shapes()[i].name;
    const double turned_rad = Eigen::AngleAxisd(before->T_world_shape[i].linear().transpose() *
                                                after->T_world_shape[i].linear())
                                  .angle();
    const bool is_head = name == "hsr/head_pan_link" || name == "hsr/head_tilt_link";
    EXPECT_NEAR(turned_rad, is_head ? 1.0 : 0.0, 1e-6) << name;
    EXPECT_NE(name, "hsr/head_rgbd_sensor_link");
  }
}

TEST_F(MountedHead, LeavesCamerasAloneThatItDoesNotCarry) {
  mount_.link = "hand_palm_link";
  MountedCamera camera = make();
  const auto before = camera.view(Stamp::from_seconds(0.0));
  hsr_.motion().record_head({1.0, -0.7}, Stamp::from_seconds(0.5));
  const auto after = camera.view(Stamp::from_seconds(1.0));
  EXPECT_LT((before->T_world_camera.matrix() - after->T_world_camera.matrix()).norm(), 1e-12);
}

TEST_F(MountedHead, TellsWhatTheRobotLacks) {
  mount_.link = "head_rgb_sensor_link";
  const auto made = MountedCamera::create(mount_, hsr_.context());
  ASSERT_FALSE(made);
  EXPECT_THAT(made.error().describe(), HasSubstr("no link 'head_rgb_sensor_link' (did you mean"));
}

TEST(MountedCamera, NeedsARobotThatMoves) {
  conformance::TestHostParts parts = testing::host_parts();
  parts.robot = testing_support::flying_ball(0.1);
  const auto still =
      MountedCamera::create({.link = "ball"}, conformance::TestHost(1, parts).context());
  ASSERT_FALSE(still);
  EXPECT_EQ(still.error().code, ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace sidestep::simulator
