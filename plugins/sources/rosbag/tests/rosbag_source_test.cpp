#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bag_writing.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::rosbag::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kTight = 1e-9;

double difference(const Transform& a, const Transform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

/// A camera that moves along x at 1 m/s and turns at 1 rad/s.
Transform T_map_moving(double t) {
  return transform_from_xyz_rpy({t, 0.5, 1.0}, {-0.5, 0.1, 1.0 * t});
}

class RosbagSource : public ::testing::Test {
 protected:
  void write_camera_info(BagWriter& bag) {
    bag.write("/camera/depth/camera_info", after_s(0.0),
              ros_messages::to_camera_info(kCamera, after_s(0.0), "camera"));
  }
  /// tf of the moving camera, 20 a second in [from, to] s.
  void write_tf(BagWriter& bag, double from_s, double to_s) {
    for (double t = from_s; t <= to_s + 1e-9; t += 0.05) {
      bag.write("/tf", after_s(t), tf_message(T_map_moving(t), after_s(t), "map", "camera"));
    }
  }
  Error refusal(const Options& options) {
    auto source = create_source(options, host_.context());
    EXPECT_FALSE(source);
    return source ? Error{} : source.error();
  }
  Outcome read(const Options& options) { return read_all(options, host_.context()); }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "test.bag";
  conformance::TestHost host_;
};

TEST_F(RosbagSource, HandsOutDepthImagesWhereTheCameraWas) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.0, 1.0);
    for (int i = 0; i < 10; ++i) {
      const Stamp stamp = after_s(0.1 * i + 0.02);
      bag.write("/camera/depth/image", after_s(0.1 * i + 0.05), flat_image(1500 + i, stamp));
    }
  }
  auto source = create_source(options_of(file_), host_.context());
  ASSERT_TRUE(source) << source.error().describe();
  EXPECT_EQ((*source)->frame_count(), 10);
  const auto frames = testing_support::read_frames(**source, 20);
  ASSERT_THAT(frames, SizeIs(10));
  for (int i = 0; i < 10; ++i) {
    const auto& frame = frames[static_cast<std::size_t>(i)];
    ASSERT_TRUE(frame) << frame.error().describe();
    EXPECT_EQ(frame->sequence, i);
    EXPECT_EQ(frame->stamp, after_s(0.1 * i + 0.02));
    EXPECT_FALSE(frame->joint_positions);
    const auto& image = std::get<DepthImage>(frame->measurement);
    EXPECT_EQ(image.camera.fx_px, kCamera.fx_px);
    EXPECT_EQ(image.camera.width_px, 40);
    EXPECT_EQ(image.depth_m, std::vector<float>(1200, static_cast<float>((1500 + i) / 1000.0)));
    // tf is linear in position between its times; turns are uniform about a fixed axis of the
    // world.
    EXPECT_LT(difference(frame->T_world_camera, T_map_moving(0.1 * i + 0.02)), 1e-7);
  }
  EXPECT_EQ(host_.log().count(LogLevel::kWarning), 0);
}

/// tf of a frame may be recorded before or long after its image.
TEST_F(RosbagSource, DoesNotMindTheOrderOfRecording) {
  {
    BagWriter bag(file_);
    for (int i = 3; i-- > 0;) {
      bag.write("/camera/depth/image", after_s(5.0 - i), flat_image(1000, after_s(0.1 * i + 0.02)));
    }
    write_tf(bag, 0.2, 0.4);
    write_tf(bag, 0.0, 0.15);
    write_camera_info(bag);
  }
  const Outcome outcome = read(options_of(file_));
  EXPECT_THAT(outcome.errors, IsEmpty());
  ASSERT_THAT(outcome.frames, SizeIs(3));
  for (int i = 0; i < 3; ++i) {
    const Frame& frame = outcome.frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.stamp, after_s(0.1 * i + 0.02));
    EXPECT_LT(difference(frame.T_world_camera, T_map_moving(0.1 * i + 0.02)), 1e-7);
  }
}

TEST_F(RosbagSource, DropsFramesWithoutAPoseAndSaysWhy) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.2, 0.4);
    write_tf(bag, 1.0, 1.2);
    for (const double t : {0.1, 0.3, 0.7, 1.1, 1.5}) {
      bag.write("/camera/depth/image", after_s(t), flat_image(1000, after_s(t)));
    }
  }
  Options options = options_of(file_);
  const Outcome outcome = read(options);
  EXPECT_THAT(outcome.frames, SizeIs(2));
  ASSERT_THAT(outcome.errors, SizeIs(3));
  const char* const reasons[] = {"begins later", "gap", "ends earlier"};
  const char* const numbers[] = {"frame 0 ", "frame 2 ", "frame 4 "};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(outcome.errors[i].code, ErrorCode::kBadFrame);
    EXPECT_THAT(outcome.errors[i].message, AllOf(HasSubstr(reasons[i]), HasSubstr("'camera'")));
    EXPECT_THAT(outcome.errors[i].where, AllOf(HasSubstr(numbers[i]), HasSubstr("test.bag")));
  }
  options.pose.max_gap_s = 0.7;
  EXPECT_THAT(read(options).frames, SizeIs(3));
}

TEST_F(RosbagSource, LooksPosesUpAsMuchLaterAsTheClocksDiffer) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.0, 1.0);
    bag.write("/camera/depth/image", after_s(9.0), flat_image(1000, after_s(5.0)));
  }
  Options options = options_of(file_);
  options.pose.offset_s = -4.4;
  Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(1));
  EXPECT_EQ(outcome.frames[0].stamp, after_s(5.0));
  EXPECT_LT(difference(outcome.frames[0].T_world_camera, T_map_moving(0.6)), 1e-6);
  options.pose.offset_s = -8.4;
  options.stamps = "received";
  outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(1));
  EXPECT_EQ(outcome.frames[0].stamp, after_s(9.0));
}

TEST_F(RosbagSource, TakesOnlyTheFramesThatAreAskedFor) {
  write_flat_bag(file_, 20, {});
  Options options = options_of(file_);
  options.first_frame = 3;
  options.stride = 4;
  options.max_frames = 3;
  const Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(3));
  EXPECT_EQ(outcome.frames[0].stamp, after_s(0.3));
  EXPECT_EQ(outcome.frames[2].stamp, after_s(1.1));
  EXPECT_EQ(outcome.frames[2].sequence, 2);
  options.first_frame = 20;
  EXPECT_THAT(refusal(options).message, HasSubstr("only 20 frames"));
}

TEST_F(RosbagSource, CountsForTheLogWhatItReadAndPassedOver) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.0, 0.4);
    for (const double t : {0.1, 0.3, 1.5}) {
      bag.write("/camera/depth/image", after_s(t), flat_image(1000, after_s(t)));
    }
    bag.write("/other", after_s(0.2), flat_image(1000, after_s(0.2)));
    bag.write("/tf_static", after_s(0.2), flat_image(1000, after_s(0.2)));
  }
  conformance::TestHost host;
  (void)testing::read_all(options_of(file_), host.context());
  const std::string bag = file_.string();
  EXPECT_THAT(host.log().messages(),
              ::testing::IsSupersetOf(
                  {bag + ": 2 of 3 frames handed out, 1 unusable",
                   bag + ": messages on /tf_static of sensor_msgs/Image are not read: not of "
                         "tf/tfMessage, tf2_msgs/TFMessage as ROS 1 defines it"}));
  EXPECT_THAT(host.log().messages(),
              ::testing::Contains(AllOf(HasSubstr("read " + bag +
                                                  ": messages 1 on "
                                                  "/camera/depth/camera_info, 3 on "
                                                  "/camera/depth/image, "),
                                        HasSubstr(" on /tf; passed over: 1 on /other, 1 on "
                                                  "/tf_static"))));
}

TEST_F(RosbagSource, IsTheSameEveryTime) {
  write_flat_bag(file_, 20, {::rosbag::compression::LZ4, 6000});
  const Outcome first = read(options_of(file_));
  const Outcome second = read(options_of(file_));
  ASSERT_EQ(first.frames.size(), second.frames.size());
  for (std::size_t i = 0; i < first.frames.size(); ++i) {
    EXPECT_EQ(first.frames[i].stamp, second.frames[i].stamp);
    EXPECT_EQ(first.frames[i].T_world_camera.matrix(), second.frames[i].T_world_camera.matrix());
    EXPECT_EQ(std::get<DepthImage>(first.frames[i].measurement).depth_m,
              std::get<DepthImage>(second.frames[i].measurement).depth_m);
  }
}

TEST_F(RosbagSource, StopsWhenItIsTold) {
  write_flat_bag(file_, 3, {});
  auto source = create_source(options_of(file_), host_.context());
  ASSERT_TRUE(source) << source.error().describe();
  EXPECT_EQ((*source)->next(Deadline::after_s(-1.0)).error().code, ErrorCode::kDeadlineExceeded);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ((*source)->next(Deadline(stop.get_token())).error().code, ErrorCode::kCancelled);
  EXPECT_EQ((*source)->next(Deadline()).value()->sequence, 0) << "no frame was lost";
}

/// The layout of the Cow and Lady recording: clouds of the camera, a motion capture that tells
/// where the markers are, and the calibration of the camera to the markers, part of it inverse.
TEST_F(RosbagSource, ReadsCloudsWithMotionCaptureAndCalibration) {
  const Transform T_camera_rgb = transform_from_xyz_rpy({0.02, 0.0, 0.01}, {0.01, -0.02, 0.03});
  const Transform T_marker_rgb = transform_from_xyz_rpy({0.1, -0.2, 0.3}, {1.5, 0.2, -1.4});
  const Transform T_world_lab = transform_from_xyz_rpy({0.0, 0.0, 0.7}, {0.0, 0.0, 0.5});
  const PointCloud cloud{{{0.1F, 0.2F, 1.0F}, {-0.3F, 0.1F, 2.0F}}};
  {
    BagWriter bag(file_);
    for (int i = 0; i <= 20; ++i) {
      const Stamp stamp = after_s(0.1 * i);
      bag.write(
          "/kinect/vrpn_client/estimated_transform", stamp,
          to_transform(ros_messages::rigid_pose(T_map_moving(0.1 * i)), stamp, "vicon", "kinect"));
    }
    for (int i = 0; i < 5; ++i) {
      const Stamp stamp = after_s(0.3 * i + 0.07);
      bag.write("/camera/depth_registered/points", stamp,
                ros_messages::to_point_cloud(cloud, stamp, "camera_rgb_optical_frame"));
    }
  }
  Options options;
  options.path = file_;
  options.topic = "/camera/depth_registered/points";
  options.pose.from = "topic";
  options.pose.topic = "/kinect/vrpn_client/estimated_transform";
  CalibrationStep inverse_step;
  inverse_step.inverse = true;
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = T_camera_rgb.matrix();
  inverse_step.matrix.assign(matrix.data(), matrix.data() + 16);
  options.pose.T_body_camera = {{.xyz_m = {0.1, -0.2, 0.3}, .rpy_rad = {1.5, 0.2, -1.4}},
                                inverse_step};
  options.pose.T_world_reference = {{.xyz_m = {0.0, 0.0, 0.7}, .rpy_rad = {0.0, 0.0, 0.5}}};
  ASSERT_THAT(options.check(), IsEmpty());

  const Outcome outcome = read(options);
  EXPECT_THAT(outcome.errors, IsEmpty());
  ASSERT_THAT(outcome.frames, SizeIs(5));
  for (int i = 0; i < 5; ++i) {
    const Frame& frame = outcome.frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(std::get<PointCloud>(frame.measurement).points_m, cloud.points_m);
    const Transform expected =
        T_world_lab * T_map_moving(0.3 * i + 0.07) * T_marker_rgb * T_camera_rgb.inverse();
    EXPECT_LT(difference(frame.T_world_camera, expected), 1e-6) << i;
  }
}

TEST_F(RosbagSource, ReadsPosesOfOtherMessagesAndTheirInverse) {
  const Transform T_map_camera = T_map_moving(0.4);
  const auto told = ros_messages::to_transform(ros_messages::rigid_pose(T_map_camera), after_s(1.0),
                                               "map", "camera");
  ros_messages::PoseStamped pose;
  pose.header = told.header;
  pose.pose.position.x = told.transform.translation.x;
  pose.pose.position.y = told.transform.translation.y;
  pose.pose.position.z = told.transform.translation.z;
  pose.pose.orientation = told.transform.rotation;
  ros_messages::Odometry odometry;
  odometry.header = told.header;
  odometry.pose.pose = pose.pose;
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    bag.write("/pose", after_s(1.0), pose);
    bag.write("/odometry", after_s(1.0), odometry);
    bag.write("/transform", after_s(1.0), told);
    bag.write("/camera/depth/image", after_s(1.0), flat_image(1000, after_s(1.0)));
  }
  Options options = options_of(file_);
  options.pose.from = "topic";
  for (const char* const topic : {"/pose", "/odometry", "/transform"}) {
    options.pose.topic = topic;
    const Outcome outcome = read(options);
    ASSERT_THAT(outcome.frames, SizeIs(1)) << topic;
    EXPECT_LT(difference(outcome.frames[0].T_world_camera, T_map_camera), kTight) << topic;
  }
  options.pose.inverse = true;
  const Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(1));
  EXPECT_LT(difference(outcome.frames[0].T_world_camera, T_map_camera.inverse()), kTight);
}

/// A lidar's points keep their places in the world, whatever axes its frame has.
TEST_F(RosbagSource, TurnsCloudsWithXForwardToOpticalAxes) {
  const PointCloud cloud{{{1.0F, 0.2F, -0.3F}, {4.0F, -1.0F, 0.5F}}};
  const Transform T_map_lidar = T_map_moving(0.3);
  {
    BagWriter bag(file_);
    bag.write("/tf_static", after_s(0.0), tf_message(T_map_lidar, after_s(0.0), "map", "lidar"));
    bag.write("/points", after_s(1.0), ros_messages::to_point_cloud(cloud, after_s(1.0), "lidar"));
  }
  Options options = options_of(file_);
  options.topic = "/points";
  options.points_in = "forward";
  const Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(1));
  const Frame& frame = outcome.frames[0];
  const auto& points = std::get<PointCloud>(frame.measurement).points_m;
  ASSERT_THAT(points, SizeIs(2));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_LT((frame.T_world_camera * points[i].cast<double>() -
               T_map_lidar * cloud.points_m[i].cast<double>())
                  .norm(),
              1e-6);
    EXPECT_GT(points[i].z(), 0.9F) << "in front of the camera";
  }
}

TEST_F(RosbagSource, ReadsScansOfALaser) {
  const PointCloud scan{{{1.0F, -1.0F, 0.0F}, {2.0F, 0.0F, 0.0F}, {0.5F, 0.5F, 0.0F}}};
  constexpr double kQuarter_rad = 0.7853981633974483;
  const Transform T_map_laser = T_map_moving(0.3);
  {
    BagWriter bag(file_);
    bag.write("/tf_static", after_s(0.0), tf_message(T_map_laser, after_s(0.0), "map", "laser"));
    bag.write("/base_scan", after_s(1.0),
              ros_messages::to_laser_scan(scan, -kQuarter_rad, kQuarter_rad, {0.1, 20.0},
                                          after_s(1.0), "laser"));
  }
  Options options = options_of(file_);
  options.topic = "/base_scan";
  const Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(1));
  EXPECT_LT((outcome.frames[0].T_world_camera.matrix() - T_map_laser.matrix()).norm(), 1e-6);
  const auto& points = std::get<PointCloud>(outcome.frames[0].measurement).points_m;
  ASSERT_THAT(points, SizeIs(3));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT((points[i] - scan.points_m[i]).norm(), 1e-5F);
}

/// A camera's calibration may be told anew during a recording.
TEST_F(RosbagSource, TakesTheCameraInfoOfTheTime) {
  CameraIntrinsics other = kCamera;
  other.fx_px = 50.0;
  {
    BagWriter bag(file_);
    bag.write("/tf_static", after_s(0.0),
              tf_message(Transform::Identity(), after_s(0.0), "map", "camera"));
    for (int i = 0; i < 4; ++i) {
      const Stamp stamp = after_s(i);
      bag.write("/info", stamp, ros_messages::to_camera_info(i < 2 ? kCamera : other, stamp, "c"));
      bag.write("/camera/depth/image", stamp, flat_image(1000, after_s(i - 0.1)));
    }
  }
  Options options = options_of(file_);
  options.camera_info_topic = "/info";
  const Outcome outcome = read(options);
  ASSERT_THAT(outcome.frames, SizeIs(4));
  std::vector<double> focal_px;
  for (const Frame& frame : outcome.frames) {
    focal_px.push_back(std::get<DepthImage>(frame.measurement).camera.fx_px);
  }
  EXPECT_THAT(focal_px, ElementsAre(35.0, 35.0, 35.0, 50.0));
  options.camera_info_topic = "/none";
  EXPECT_THAT(refusal(options).message, HasSubstr("no camera info"));
  options.camera = {60.0, 60.0, 20.0, 15.0};
  const Outcome given = read(options);
  ASSERT_THAT(given.frames, SizeIs(4));
  EXPECT_EQ(std::get<DepthImage>(given.frames[0].measurement).camera.fx_px, 60.0);
}

TEST_F(RosbagSource, SaysWhichTopicsTheBagHas) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.0, 1.0);
    bag.write("/camera/depth/image", after_s(0.5), flat_image(1000, after_s(0.5)));
  }
  Options options = options_of(file_);
  options.topic = "/camera/depth/imgae";
  Error error = refusal(options);
  EXPECT_EQ(error.code, ErrorCode::kConfig);
  EXPECT_THAT(error.message, HasSubstr("'/camera/depth/imgae'"));
  EXPECT_THAT(error.hint, AllOf(HasSubstr("/camera/depth/image (sensor_msgs/Image)"),
                                HasSubstr("/tf (tf2_msgs/TFMessage)")));
  options.topic = "/tf";
  error = refusal(options);
  EXPECT_THAT(error.message,
              AllOf(HasSubstr("tf2_msgs/TFMessage"), HasSubstr("sensor_msgs/Image")));
  options = options_of(file_);
  options.pose.from = "topic";
  options.pose.topic = "/mocap";
  EXPECT_THAT(refusal(options).message, HasSubstr("'/mocap'"));
  options = options_of(file_);
  options.pose.world_frame = "world";
  error = refusal(options);
  EXPECT_EQ(error.code, ErrorCode::kConfig);
  EXPECT_THAT(error.message, HasSubstr("'world'"));
  EXPECT_THAT(error.hint, HasSubstr("map"));
}

TEST_F(RosbagSource, CountsMessagesThatAreOfNoUse) {
  {
    BagWriter bag(file_);
    write_camera_info(bag);
    write_tf(bag, 0.0, 1.0);
    auto broken = tf_message(Transform::Identity(), after_s(2.0), "map", "camera");
    broken.transforms[0].transform.rotation.w = 0.0;
    bag.write("/tf", after_s(2.0), broken);
    bag.write("/camera/depth/image", after_s(0.5), flat_image(1000, after_s(0.5)));
    auto small = flat_image(1000, after_s(0.6));
    small.data.resize(100);
    bag.write("/camera/depth/image", after_s(0.6), small);
  }
  const Outcome outcome = read(options_of(file_));
  EXPECT_THAT(outcome.frames, SizeIs(1));
  ASSERT_THAT(outcome.errors, SizeIs(1));
  EXPECT_THAT(outcome.errors[0].message, HasSubstr("100 bytes"));
  EXPECT_EQ(host_.log().count(LogLevel::kWarning), 1);
  EXPECT_THAT(host_.log().messages(),
              ::testing::Contains(AllOf(HasSubstr("/tf"), HasSubstr(", 1 are damaged"))));
}

}  // namespace
}  // namespace sidestep::rosbag::testing
