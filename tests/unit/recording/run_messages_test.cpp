#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "run_messages.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::testing {
namespace {

const ros::Header kHeader{0, {5, 6}, "camera"};
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

template <class Number>
Number at(const std::vector<std::byte>& bytes, std::size_t index) {
  Number number;
  std::memcpy(&number, bytes.data() + index * sizeof number, sizeof number);
  return number;
}

TEST(RosTime, IsASecondAheadOfTheRunsClock) {
  EXPECT_EQ(ros_time(Stamp{0}), (ros::Time{1, 0}));
  EXPECT_EQ(ros_time(Stamp{2'500'000'001}), (ros::Time{3, 500'000'001}));
  EXPECT_EQ(ros_time(Stamp{-400'000'000}), (ros::Time{0, 600'000'000}));
  EXPECT_EQ(ros_time(Stamp{1'305'031'102'000'000'003}), (ros::Time{1'305'031'103, 3}));
  EXPECT_EQ(ros_time(Stamp{5}, Stamp{40'000'000'000}), (ros::Time{40, 5}));
}

TEST(RosTime, IsNeverZeroAndNeverTooLate) {
  EXPECT_EQ(ros_time(Stamp{-1'000'000'000}), (ros::Time{0, 1}));
  EXPECT_EQ(ros_time(Stamp{std::numeric_limits<std::int64_t>::min()}), (ros::Time{0, 1}));
  EXPECT_EQ(ros_time(Stamp{std::numeric_limits<std::int64_t>::max()}), (ros::Time{~0U, 0}));
}

TEST(RosTime, LeadsBackToTheStamp) {
  for (const std::int64_t ns : {0LL, 1LL, -999'999'999LL, 12'345'678'901LL}) {
    EXPECT_EQ(run_stamp(ros_time(Stamp{ns})), Stamp{ns});
    EXPECT_EQ(run_stamp(ros_time(Stamp{ns}, Stamp{7'000'000'000}), Stamp{7'000'000'000}),
              Stamp{ns});
  }
}

DepthImage image_of(std::vector<float> depth_m, int width_px) {
  const auto height_px = static_cast<int>(depth_m.size()) / width_px;
  return {{width_px, height_px, 75.0, 76.0, 1.5, 0.5}, std::move(depth_m)};
}

TEST(DepthImageMessage, IsInMillimetresWhereThatLosesNothing) {
  std::vector<float> depth_m{0.0F, kNaN, -1.0F};
  std::vector<int> depth_mm{0, 0, 0};
  for (int mm = 1; mm <= 65535; mm += 97) {
    depth_m.push_back(static_cast<float>(mm) / 1000.0F);
    depth_mm.push_back(mm);
  }
  while (depth_m.size() % 4 != 0) depth_m.push_back(0.0F), depth_mm.push_back(0);
  const ros::Image image = depth_image(image_of(depth_m, 4), kHeader);
  EXPECT_EQ(image.encoding, "16UC1");
  EXPECT_EQ(image.width, 4U);
  EXPECT_EQ(image.height, depth_m.size() / 4);
  EXPECT_EQ(image.step, 8U);
  ASSERT_EQ(image.data.size(), 2 * depth_m.size());
  for (std::size_t i = 0; i < depth_m.size(); ++i) {
    EXPECT_EQ(at<std::uint16_t>(image.data, i), depth_mm[i]) << depth_m[i];
  }
}

TEST(DepthImageMessage, IsInMetresWhereMillimetresWouldLose) {
  for (const float odd_m : {1.2345F, 0.0004F, 65.536F, std::numeric_limits<float>::infinity()}) {
    const ros::Image image = depth_image(image_of({0.5F, odd_m, 0.0F, kNaN}, 2), kHeader);
    EXPECT_EQ(image.encoding, "32FC1");
    EXPECT_EQ(image.step, 8U);
    ASSERT_EQ(image.data.size(), 16U);
    EXPECT_EQ(at<float>(image.data, 0), 0.5F);
    EXPECT_EQ(at<float>(image.data, 1), odd_m);
    EXPECT_TRUE(std::isnan(at<float>(image.data, 2)));
    EXPECT_TRUE(std::isnan(at<float>(image.data, 3)));
  }
}

TEST(CameraInfoMessage, ProjectsAsTheCameraDoes) {
  const CameraIntrinsics camera{640, 480, 525.0, 526.0, 319.5, 239.25};
  const ros::CameraInfo info = camera_info(camera, kHeader);
  EXPECT_EQ(info.width, 640U);
  EXPECT_EQ(info.height, 480U);
  const Eigen::Vector3d p = camera.unproject(100.0, 50.0, 2.0);
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> K(info.K.data());
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> P(info.P.data());
  EXPECT_TRUE((K * p).hnormalized().isApprox(Eigen::Vector2d(100.0, 50.0)));
  EXPECT_TRUE((P * p.homogeneous()).hnormalized().isApprox(Eigen::Vector2d(100.0, 50.0)));
}

TEST(PointCloudMessage, HoldsThePointsOneAfterTheOther) {
  const PointCloud cloud{{{1.0F, 2.0F, 3.0F}, {4.0F, 5.0F, kNaN}}};
  const ros::PointCloud2 message = point_cloud(cloud, kHeader);
  EXPECT_EQ(message.width, 2U);
  EXPECT_EQ(message.point_step, 12U);
  EXPECT_EQ(message.row_step, 24U);
  ASSERT_EQ(message.fields.size(), 3U);
  EXPECT_EQ(message.fields[2].name, "z");
  EXPECT_EQ(message.fields[2].offset, 8U);
  ASSERT_EQ(message.data.size(), 24U);
  EXPECT_EQ(at<float>(message.data, 3), 4.0F);
  EXPECT_TRUE(std::isnan(at<float>(message.data, 5)));
}

/// What a listener to tf makes of a message: T_world_frame, parent by parent.
Transform looked_up(const ros::TFMessage& message, const std::string& frame) {
  if (frame == kWorldFrame) return Transform::Identity();
  for (const ros::TransformStamped& one : message.transforms) {
    if (one.child_frame_id != frame) continue;
    const auto& t = one.transform.translation;
    const auto& r = one.transform.rotation;
    Transform T_parent_frame = Transform::Identity();
    T_parent_frame.translate(Eigen::Vector3d(t.x, t.y, t.z));
    T_parent_frame.rotate(Eigen::Quaterniond(r.w, r.x, r.y, r.z));
    return looked_up(message, one.header.frame_id) * T_parent_frame;
  }
  throw std::runtime_error("no transform to " + frame);
}

TEST(LinkTransforms, LeadFromTheWorldToEveryLink) {
  const auto robot = testing_support::mobile_arm();
  const RobotDescription& description = robot->description();
  const std::vector<double> q{0.4, -0.2, 2.5, 0.3, -1.0, 1.7, 0.6};
  std::vector<Transform> T_world_link(description.links.size());
  Scratch scratch;
  robot->link_poses(q, T_world_link, scratch);
  const ros::TFMessage message = link_transforms(description, T_world_link, {3, 4});
  ASSERT_EQ(message.transforms.size(), description.links.size());
  for (std::size_t i = 0; i < description.links.size(); ++i) {
    EXPECT_EQ(message.transforms[i].header.stamp, (ros::Time{3, 4}));
    EXPECT_TRUE(looked_up(message, description.links[i].name).isApprox(T_world_link[i], 1e-12))
        << description.links[i].name;
  }
}

TEST(LinkTransforms, ALinkNamedAsTheWorldIsTheWorld) {
  RobotDescription robot;
  robot.links = {{"world", -1}, {"body", 0}};
  const std::vector<Transform> T_world_link{Transform::Identity(),
                                            Transform(Eigen::Translation3d(1.0, 2.0, 3.0))};
  const ros::TFMessage message = link_transforms(robot, T_world_link, {1, 0});
  ASSERT_EQ(message.transforms.size(), 1U);
  EXPECT_EQ(message.transforms[0].header.frame_id, "world");
  EXPECT_TRUE(looked_up(message, "body").isApprox(T_world_link[1]));
}

TEST(JointTrajectoryMessage, HasPositionsVelocitiesAndTimes) {
  RobotDescription robot;
  robot.joints.resize(2);
  robot.joints[0].name = "x";
  robot.joints[1].name = "y";
  Trajectory trajectory = make_trajectory(2, 3, 0.75);
  for (std::size_t i = 0; i < 6; ++i) {
    trajectory.positions[i] = static_cast<double>(i);
    trajectory.velocities[i] = 10.0 * static_cast<double>(i);
  }
  const ros::JointTrajectory message = joint_trajectory(robot, trajectory, {9, 8});
  EXPECT_EQ(message.header.stamp, (ros::Time{9, 8}));
  EXPECT_EQ(message.joint_names, (std::vector<std::string>{"x", "y"}));
  ASSERT_EQ(message.points.size(), 3U);
  EXPECT_EQ(message.points[2].positions, (std::vector<double>{4.0, 5.0}));
  EXPECT_EQ(message.points[2].velocities, (std::vector<double>{40.0, 50.0}));
  EXPECT_EQ(message.points[2].time_from_start, (ros::Duration{1, 500'000'000}));
}

}  // namespace
}  // namespace sidestep::testing
