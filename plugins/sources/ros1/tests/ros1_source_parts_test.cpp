#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros1_source.hpp"
#include "support/ball_robot.hpp"
#include "viewpoint_feed.hpp"

namespace sidestep::ros1_source {
namespace {

using ros_messages::LookupFault;
using ::testing::ElementsAre;

Stamp at_s(double seconds) { return Stamp::from_seconds(seconds); }

/// A base that drives along x at 1 m/s and turns at 0.1 rad/s.
ros_messages::TfMessage base_at(double t) {
  ros_messages::TfMessage message;
  const Transform pose = transform_from_xyz_rpy({t, 0.5, 0.0}, {0.0, 0.0, 0.1 * t});
  message.transforms.push_back(
      ros_messages::to_transform(ros_messages::rigid_pose(pose), at_s(t), "odom", "base"));
  return message;
}

/// A metre above it.
ros_messages::TfMessage camera_on_base() {
  ros_messages::TfMessage message;
  message.transforms.push_back(ros_messages::to_transform(
      {{0.0, 0.0, 1.0}, Eigen::Quaterniond::Identity()}, {}, "base", "camera"));
  return message;
}

Options some_options() {
  Options options;
  options.world_frame = "odom";
  options.tf_max_gap_s = 0.2;
  return options;
}

ViewpointFeed feed_of(const Options& told, std::shared_ptr<const RobotModel> robot = nullptr) {
  auto feed = ViewpointFeed::create(told, std::move(robot));
  EXPECT_TRUE(feed) << feed.error().describe();
  return std::move(*feed);
}

TEST(ViewpointFeed, PlacesTheCameraAtAnImagesStamp) {
  ViewpointFeed feed = feed_of(some_options());
  EXPECT_EQ(feed.at(at_s(1.0), "camera").error().fault, LookupFault::kUnknown);
  feed.add(camera_on_base(), true);
  for (int i = 0; i <= 20; ++i) feed.add(base_at(0.1 * i), false);
  const auto viewpoint = feed.at(at_s(1.03), "camera");
  ASSERT_TRUE(viewpoint) << viewpoint.error().message;
  const Transform wanted = transform_from_xyz_rpy({1.03, 0.5, 1.0}, {0.0, 0.0, 0.103});
  EXPECT_TRUE(viewpoint->T_world_camera.isApprox(wanted, 1e-9));
  EXPECT_FALSE(viewpoint->joint_positions);
}

TEST(ViewpointFeed, SaysWhetherWhatIsMissingMayStillCome) {
  ViewpointFeed feed = feed_of(some_options());
  feed.add(camera_on_base(), true);
  for (const double t : {1.0, 1.1, 2.0}) feed.add(base_at(t), false);
  EXPECT_EQ(feed.at(at_s(2.1), "camera").error().fault, LookupFault::kTooLate);
  EXPECT_EQ(feed.at(at_s(1.5), "camera").error().fault, LookupFault::kGap);
  EXPECT_EQ(feed.at(at_s(0.9), "camera").error().fault, LookupFault::kTooEarly);
}

TEST(ViewpointFeed, TellsWhereTheRobotStoodAtThatStamp) {
  Options told = some_options();
  told.joints = JointOptions{{"/joints"}, 0.2, BaseOptions{"x", "y", "yaw", "base"}};
  const auto robot = std::make_shared<testing_support::BallRobot>(0.1);
  EXPECT_FALSE(ViewpointFeed::create(told, robot)) << "it has x, y and z, and no yaw";
  EXPECT_FALSE(ViewpointFeed::create(told, nullptr));
  told.joints->base = BaseOptions{"x", "y", "z", "base"};  // z stands for a yaw.
  ViewpointFeed of_base = feed_of(told, robot);
  told.joints->base.reset();
  ViewpointFeed of_states = feed_of(told, robot);
  for (ViewpointFeed* feed : {&of_base, &of_states}) {
    feed->add(camera_on_base(), true);
    for (int i = 0; i <= 4; ++i) feed->add(base_at(0.1 * i), false);
  }
  const auto by_tf = of_base.at(at_s(0.15), "camera");
  ASSERT_TRUE(by_tf) << by_tf.error().message;
  EXPECT_TRUE(by_tf->joint_positions->isApprox(Eigen::Vector3d(0.15, 0.5, 0.015), 1e-9));

  EXPECT_EQ(of_states.at(at_s(0.15), "camera").error().fault, LookupFault::kUnknown);
  for (const double t : {0.1, 0.2}) {
    ros_messages::JointState message;
    message.header.stamp = ros_messages::to_ros_time(at_s(t));
    message.name = {"z", "x", "y"};
    message.position = {2.0 * t, -t, 0.5};
    of_states.add(message);
  }
  const auto by_states = of_states.at(at_s(0.15), "camera");
  ASSERT_TRUE(by_states) << by_states.error().message;
  ASSERT_TRUE(by_states->joint_positions);
  EXPECT_TRUE(by_states->joint_positions->isApprox(Eigen::Vector3d(-0.15, 0.5, 0.3), 1e-9));
  EXPECT_EQ(of_states.at(at_s(0.25), "camera").error().fault, LookupFault::kTooLate);
}

class KeptLog final : public Log {
 public:
  void write(LogLevel, std::string_view message) override { lines.emplace_back(message); }
  std::vector<std::string> lines;
};

TEST(FrameDrops, AreAllCountedAndToldOnceASecond) {
  KeptLog log;
  double now_s = 100.0;
  FrameDrops drops(log, "source ros1 /depth", [&] { return now_s; });
  drops.add("tf late", "tf ends earlier");
  for (int i = 0; i < 9; ++i) {
    now_s += 0.1;
    drops.add("tf late", "tf ends earlier still");
  }
  now_s = 101.05;
  drops.add("tf jumped", "tf jumped by a metre");
  EXPECT_THAT(log.lines, ElementsAre("source ros1 /depth: dropped 1 frame: tf ends earlier",
                                     "source ros1 /depth: dropped 10 frames, the last: tf jumped "
                                     "by a metre"));
  EXPECT_EQ(drops.total(), 11);
  EXPECT_EQ(drops.describe(), "11 frames dropped: 1 tf jumped, 10 tf late");
}

}  // namespace
}  // namespace sidestep::ros1_source
