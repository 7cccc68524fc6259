#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/plugin/parameters.hpp>

#include "base_joints.hpp"

namespace sidestep::ros1_source {

/// Joints of the robot's base, whose positions are those of a frame of tf.
struct BaseOptions : ros_messages::BaseJoints {
  std::string frame = "base_footprint";
  static Parameters<BaseOptions> parameters();
};

/// Where the robot stood when a frame was taken.
struct JointOptions {
  std::vector<std::string> topics{"/hsrb/joint_states"};
  double max_gap_s = 0.2;
  std::optional<BaseOptions> base;
  static Parameters<JointOptions> parameters();
};

struct Options {
  std::string topic = "/hsrb/head_rgbd_sensor/depth_registered/image_rect_raw";
  std::string measures = "depth_image";
  std::string camera_info_topic = "/hsrb/head_rgbd_sensor/rgb/camera_info";
  std::string points_in = "optical";
  double depth_min_m = 0.0;
  double depth_max_m = 10.0;
  std::string world_frame = "odom";
  std::optional<std::string> camera_frame;
  std::vector<std::string> tf_topics{"/tf"};
  std::vector<std::string> tf_static_topics{"/tf_static"};
  double tf_max_gap_s = 0.2;
  double sync_wait_s = 0.1;
  double max_frame_age_s = 0.5;
  double max_speed_mps = 3.0;
  double max_turn_radps = 6.0;
  double clock_tolerance_s = 0.1;
  double connect_wait_s = 5.0;
  std::optional<JointOptions> joints;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
  [[nodiscard]] bool is_cloud() const { return measures == "point_cloud"; }
};

}  // namespace sidestep::ros1_source
