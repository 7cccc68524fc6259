#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/source.hpp>

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
  [[nodiscard]] bool is_image() const { return measures == "depth_image"; }
};

/// Counts frames that are dropped, and says why, once a second at most. One thread at a time.
class FrameDrops {
 public:
  /// `where` stands before what is logged; `time_s` tells any clock that goes on.
  FrameDrops(Log& log, std::string where, std::function<double()> time_s)
      : log_(log), where_(std::move(where)), time_s_(std::move(time_s)) {}

  /// `kind` in a word or two, to count by; `reason` in a sentence without full stop.
  void add(const std::string& kind, const std::string& reason);

  [[nodiscard]] std::int64_t total() const noexcept { return total_; }
  /// "3 frames dropped: 2 tf late, 1 tf jumped"
  [[nodiscard]] std::string describe() const;

 private:
  Log& log_;
  std::string where_;
  std::function<double()> time_s_;
  std::map<std::string, std::int64_t> counts_;
  std::int64_t total_ = 0;
  std::int64_t untold_ = 0;
  std::optional<double> told_s_;
};

/// A camera behind ROS 1. Waits for the master and a first frame whose pose is known. Fails with
/// kConfig where robot and options do not fit, with kNotFound where something is not there in time,
/// saying what.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::ros1_source
