#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/robot/head.hpp>

#include "robot_testing.hpp"

namespace sidestep {
namespace {

using ::testing::HasSubstr;

class HsrsHead : public ::testing::Test {
 protected:
  std::vector<Transform> links(const RobotModel& robot) const {
    std::vector<Transform> poses(robot.description().links.size());
    Scratch scratch;
    robot.link_poses(q_, poses, scratch);
    return poses;
  }
  /// How far a point lies from the line along which the camera looks, and in front of it or not.
  double off_m(const Eigen::Vector3d& p_m, const HeadAngles& angles) const {
    const Transform camera = head_.T_world_camera(angles, links(*robot_));
    const Eigen::Vector3d to = p_m - camera.translation();
    return to.dot(camera.linear().col(2)) > 0.0 ? to.cross(camera.linear().col(2)).norm() : 1e9;
  }

  testing_robot::Loader loader_;
  std::shared_ptr<const KinematicTree> robot_{loader_.load_or_fail("{profile: hsr}")};
  Head head_ = *Head::create(robot_);
  std::vector<double> q_{0.4, -0.2, 0.7, 0.3, -0.9, 0.0, -0.7, 0.0};
};

TEST_F(HsrsHead, RestsAndTurnsAsTheProfileSays) {
  EXPECT_EQ(head_.rest().pan_rad, 0.0);
  EXPECT_EQ(head_.rest().tilt_rad, -0.3);
  const HeadDescription& head = head_.description();
  EXPECT_EQ(head.pan.joint.lower, -3.84);
  EXPECT_EQ(head.tilt.joint.upper, 0.52);
  EXPECT_EQ(head.pan.joint.max_velocity, 1.0);
  const HeadAngles end = head_.within_limits({5.0, -5.0});
  EXPECT_EQ(end.pan_rad, 1.75);
  EXPECT_EQ(end.tilt_rad, -1.57);
}

TEST_F(HsrsHead, PlacesTheLinksOfARobotWhoseHeadIsThere) {
  for (const HeadAngles& angles : {HeadAngles{1.2, 0.3}, HeadAngles{-3.0, -1.1}, head_.rest()}) {
    const auto turned = loader_.load_or_fail(
        format("{profile: hsr, fixed_joints: {head_pan_joint: %g, ", angles.pan_rad) +
        format("head_tilt_joint: %g}}", angles.tilt_rad));
    const std::vector<Transform> expected = links(*turned);
    std::vector<Transform> placed = links(*robot_);
    const Transform camera = head_.T_world_camera(angles, placed);
    head_.place(angles, placed);
    for (std::size_t i = 0; i < placed.size(); ++i) {
      EXPECT_LT((placed[i].matrix() - expected[i].matrix()).norm(), 1e-9)
          << robot_->description().links[i].name;
    }
    const auto eye = static_cast<std::size_t>(head_.description().camera_link);
    EXPECT_LT((camera.matrix() - expected[eye].matrix()).norm(), 1e-9);
  }
}

TEST_F(HsrsHead, CarriesTheLinksThatHangOnIt) {
  for (int i = 0; i < std::ssize(robot_->description().links); ++i) {
    const std::string& name = robot_->description().links[idx(i)].name;
    EXPECT_EQ(head_.carries(i), name.starts_with("head_")) << name;
  }
}

TEST_F(HsrsHead, LooksAtPointsWithinItsLimits) {
  for (const Eigen::Vector3d& p_m :
       {Eigen::Vector3d(2.0, 1.0, 0.0), Eigen::Vector3d(0.9, -1.5, 1.2),
        Eigen::Vector3d(-1.0, -2.0, 0.4)}) {
    EXPECT_LT(off_m(p_m, head_.towards(p_m, links(*robot_), head_.rest())), 1e-3)
        << p_m.transpose();
  }
}

TEST_F(HsrsHead, TurnsTheOtherWayRoundWhereItsRangeAsksForIt) {
  q_.assign(8, 0.0);
  const auto pan_rad = [&](double bearing_rad, double from_rad) {
    const Eigen::Vector3d p_m(10.0 * std::cos(bearing_rad), 10.0 * std::sin(bearing_rad), 0.9);
    return head_.towards(p_m, links(*robot_), {from_rad, 0.0}).pan_rad;
  };
  EXPECT_NEAR(pan_rad(1.5, 0.0), 1.5, 0.02);
  // 2.5 rad is out of reach, -3.78 rad is not.
  EXPECT_NEAR(pan_rad(2.5, 0.0), 2.5 - 2.0 * std::numbers::pi, 0.02);
  // 2 rad is neither from the left nor, as -4.28 rad, from the right: the nearer end is 1.75 rad.
  EXPECT_NEAR(pan_rad(2.0, 0.0), 1.75, 1e-9);
}

TEST(Head, IsToldWhereARobotHasNone) {
  testing_robot::Loader loader;
  const auto head = Head::create(loader.load_or_fail("{profile: panda}"));
  ASSERT_FALSE(head);
  EXPECT_EQ(head.error().code, ErrorCode::kUnsupported);
  EXPECT_THAT(head.error().describe(), HasSubstr("robot 'panda' has no head that turns"));
}

}  // namespace
}  // namespace sidestep
