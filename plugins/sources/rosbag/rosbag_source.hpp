#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/transform.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/source.hpp>

#include "base_joints.hpp"

namespace sidestep::rosbag {

/// Intrinsics where no camera info tells them, or instead of what it tells.
struct CameraOptions {
  std::optional<double> fx_px;
  std::optional<double> fy_px;
  std::optional<double> cx_px;
  std::optional<double> cy_px;
  static Parameters<CameraOptions> parameters();
};

/// One rigid transform of a product.
struct CalibrationStep {
  std::vector<double> matrix;
  Eigen::Vector3d xyz_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();
  bool inverse = false;
  static Parameters<CalibrationStep> parameters();
};

/// The product of the steps; of a matrix, the rigid transform nearest to it. check() has found
/// nothing wrong with them.
[[nodiscard]] Transform product(const std::vector<CalibrationStep>& steps);

/// Where the camera is: T_world_reference * what the bag tells * T_body_camera.
struct PoseOptions {
  std::string from = "tf";
  std::vector<std::string> tf_topics{"/tf"};
  std::vector<std::string> tf_static_topics{"/tf_static"};
  std::string world_frame = "map";
  std::optional<std::string> camera_frame;
  std::optional<std::string> topic;
  bool inverse = false;
  std::vector<CalibrationStep> T_world_reference;
  std::vector<CalibrationStep> T_body_camera;
  double max_gap_s = 0.1;
  double offset_s = 0.0;
  static Parameters<PoseOptions> parameters();
};

/// Joints of the robot's base, whose positions are those of a frame.
struct BaseOptions : ros_messages::BaseJoints {
  std::string from = "tf";
  std::string frame = "base_footprint";
  std::optional<std::string> topic;
  static Parameters<BaseOptions> parameters();
};

/// A joint that no message tells of.
struct FixedJoint {
  std::string joint;
  double position = 0.0;
  static Parameters<FixedJoint> parameters();
};

struct JointOptions {
  std::vector<std::string> topics{"/joint_states"};
  double max_gap_s = 0.1;
  std::optional<BaseOptions> base;
  std::vector<FixedJoint> fixed;
  static Parameters<JointOptions> parameters();
};

struct Options {
  std::filesystem::path path;
  std::string topic;
  std::optional<std::string> camera_info_topic;
  CameraOptions camera;
  std::string points_in = "optical";
  double depth_min_m = 0.0;
  double depth_max_m = 10.0;
  std::string stamps = "header";
  PoseOptions pose;
  std::optional<JointOptions> joints;
  int first_frame = 0;
  int max_frames = 0;
  int stride = 1;
  std::string pace = "as_fast_as_possible";
  double rate = 1.0;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// The frames of a bag. Goes through the whole bag once, for everything but images and clouds.
/// Fails as Bag::open(), read_recording() and Viewpoints::create() do.
///
/// A frame that cannot be made (no pose, a damaged message) fails with kBadFrame, and the next call
/// goes on; after the last frame each place where the bag is damaged fails so once, naming the byte
/// and the time.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::rosbag
