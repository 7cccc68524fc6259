#include "../viewpoint.hpp"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hsr_on_its_way.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::simulator {
namespace {

using ::testing::HasSubstr;

class MountedHead : public ::testing::Test {
 protected:
  MountedCamera make() {
    auto made = MountedCamera::create(mount_, hsr_->context());
    if (!made) throw std::runtime_error(made.error().describe());
    return std::move(*made);
  }
  std::string why() {
    const auto made = MountedCamera::create(mount_, hsr_->context());
    return made ? std::string("made") : made.error().describe();
  }
  static Eigen::Vector3d axis(const View& view) { return view.T_world_camera.linear().col(2); }
  static double heading_rad(const View& view) { return std::atan2(axis(view).y(), axis(view).x()); }
  /// Moves the base by `velocity` from 0 s to 10 s.
  void drive(const Eigen::Vector2d& velocity_mps) {
    Eigen::VectorXd qdot = Eigen::VectorXd::Zero(8);
    qdot.head<2>() = velocity_mps;
    hsr_->move(hsr_->pose("go"), qdot, 0.0, 10.0);
  }

  std::optional<testing::HsrOnItsWay> hsr_{std::in_place};
  MountOptions mount_{.link = "head_rgbd_sensor_link"};
};

TEST_F(MountedHead, StaysAsTheProfileHasItWhereItIsFixed) {
  drive({0.0, 0.2});
  MountedCamera camera = make();
  for (const double t : {0.0, 3.0, 9.0}) {
    const auto view = camera.view(Stamp::from_seconds(t));
    EXPECT_NEAR((axis(*view) - Eigen::Vector3d(std::cos(0.3), 0.0, -std::sin(0.3))).norm(), 0.0,
                1e-9);
  }
}

TEST_F(MountedHead, PansToWhereTheBaseMovesNoFasterThanItCan) {
  mount_.head.look = "along_motion";
  drive({0.0, 0.2});
  MountedCamera camera = make();
  // A quarter turn at 1 rad/s.
  for (int i = 0; i <= 20; ++i) {
    const double t = 0.1 * i;
    const auto view = camera.view(Stamp::from_seconds(t));
    EXPECT_NEAR(heading_rad(*view), std::min(t, std::numbers::pi / 2), 1e-6) << t;
    EXPECT_NEAR(axis(*view).z(), -std::sin(0.3), 1e-9);
  }
}

TEST_F(MountedHead, PansTheOtherWayRoundWhereItsRangeAsksForIt) {
  mount_.head.look = "along_motion";
  mount_.head.speed_radps = 100.0;
  const auto settled = [&](const Eigen::Vector2d& velocity_mps) {
    hsr_.emplace();
    drive(velocity_mps);
    MountedCamera camera = make();
    EXPECT_TRUE(camera.view(Stamp::from_seconds(0.0)));
    return heading_rad(*camera.view(Stamp::from_seconds(1.0)));
  };
  EXPECT_NEAR(std::abs(settled({-0.2, 0.0})), std::numbers::pi, 1e-6);
  // 2.5 rad is out of reach, -3.78 rad is not.
  EXPECT_NEAR(settled(0.2 * Eigen::Vector2d(std::cos(2.5), std::sin(2.5))), 2.5, 1e-6);
  // 2 rad is neither from the left nor, as -4.28 rad, from the right: the nearer end is 1.75 rad.
  EXPECT_NEAR(settled(0.2 * Eigen::Vector2d(std::cos(2.0), std::sin(2.0))), 1.75, 1e-6);
}

TEST_F(MountedHead, KeepsItsAimWhereTheBaseRests) {
  mount_.head.look = "along_motion";
  Eigen::VectorXd q = hsr_->pose("go");
  Eigen::VectorXd qdot = Eigen::VectorXd::Zero(8);
  qdot[1] = 0.2;
  hsr_->move(q, qdot, 0.0, 2.0);
  q[1] += 0.4;
  qdot.setZero();
  qdot[hsr_->joint("odom_t")] = 0.0;
  hsr_->move(q, qdot, 2.01, 4.0);
  MountedCamera camera = make();
  for (int i = 0; i <= 40; ++i) EXPECT_TRUE(camera.view(Stamp::from_seconds(0.1 * i)));
  EXPECT_NEAR(heading_rad(*camera.view(Stamp::from_seconds(4.0))), std::numbers::pi / 2, 1e-6);
}

TEST_F(MountedHead, LooksAtWhereALinkWillBe) {
  mount_.head.look = "ahead";
  mount_.head.ahead_s = 1.5;
  const Eigen::VectorXd q = hsr_->pose("reach_table");
  hsr_->move(q, Eigen::VectorXd::Zero(8), 0.0, 10.0);
  const auto distance_m = [&](const View& view, const Eigen::VectorXd& where) {
    const Eigen::Vector3d p = hsr_->link(hsr_->links(where), "hand_palm_link").translation();
    return (p - view.T_world_camera.translation()).cross(axis(view)).norm();
  };
  MountedCamera camera = make();
  for (int i = 0; i < 30; ++i) EXPECT_TRUE(camera.view(Stamp::from_seconds(0.1 * i)));
  EXPECT_LT(distance_m(*camera.view(Stamp::from_seconds(3.0)), q), 1e-3);

  Eigen::VectorXd end = q;
  end[1] += 0.4;
  end[hsr_->joint("arm_lift_joint")] += 0.2;
  hsr_->motion().follow(
      straight_line({q, Eigen::VectorXd::Zero(8)}, {end, Eigen::VectorXd::Zero(8)}, 11, 0.2),
      Stamp::from_seconds(3.0));
  for (int i = 31; i <= 60; ++i) {
    const Stamp stamp = Stamp::from_seconds(0.1 * i);
    const auto view = camera.view(stamp);
    if (i < 40) continue;  // the head turns to the new aim
    const auto later = hsr_->motion().planned(Stamp::from_seconds(0.1 * i + 1.5));
    EXPECT_LT(distance_m(*view, later->q), 2e-3) << i;
  }
}

TEST_F(MountedHead, TakesTheRobotsHeadWithIt) {
  mount_.head.look = "along_motion";
  drive({0.0, 0.2});
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
    EXPECT_NEAR(turned_rad, is_head ? std::numbers::pi / 2 : 0.0, 1e-6) << name;
    EXPECT_NE(name, "hsr/head_rgbd_sensor_link");
  }
}

TEST_F(MountedHead, TellsWhatTheRobotLacks) {
  mount_.link = "head_rgb_sensor_link";
  EXPECT_THAT(why(), HasSubstr("no link 'head_rgb_sensor_link' (did you mean"));
  mount_.link = "hand_palm_link";
  mount_.head.look = "along_motion";
  EXPECT_THAT(why(), HasSubstr("does not carry"));
  mount_.link = "head_rgbd_sensor_link";
  mount_.head.pan_joint = "arm_flex_joint";
  EXPECT_THAT(why(), HasSubstr("'arm_flex_joint' is planned"));
  mount_.head.pan_joint = "head_pan";
  EXPECT_THAT(why(), HasSubstr("no joint 'head_pan' that turns"));
  mount_.head.base_link = "base";
  EXPECT_THAT(why(), HasSubstr("no link 'base'"));
}

TEST(MountedCamera, NeedsARobotThatMovesAndAHeadNeedsItsJoints) {
  const MountOptions mount{.link = "ball", .head = {.look = "along_motion", .base_link = "ball"}};
  conformance::TestHostParts parts = testing::host_parts();
  parts.robot = testing_support::flying_ball(0.1);
  const auto still = MountedCamera::create(mount, conformance::TestHost(1, parts).context());
  ASSERT_FALSE(still);
  EXPECT_EQ(still.error().code, ErrorCode::kUnsupported);
  parts.motion = std::make_shared<RobotMotion>();
  const auto headless = MountedCamera::create(mount, conformance::TestHost(1, parts).context());
  ASSERT_FALSE(headless);
  EXPECT_THAT(headless.error().describe(), HasSubstr("does not tell its joints"));
}

}  // namespace
}  // namespace sidestep::simulator
