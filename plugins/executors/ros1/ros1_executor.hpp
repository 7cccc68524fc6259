#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/planning/executor.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "base_joints.hpp"

namespace sidestep::ros1_executor {

/// Where the base is, of nav_msgs/Odometry.
struct OdometryOptions : ros_messages::BaseJoints {
  std::string topic = "/hsrb/odom";
  std::string twist_in = "base";
  static Parameters<OdometryOptions> parameters();
};

/// Joints that one controller moves.
struct ControllerEntry {
  std::string command_topic;
  std::optional<std::string> state_topic;
  std::vector<std::string> joints;
  static Parameters<ControllerEntry> parameters();
};

/// Who drives the base where no controller moves its joints.
struct TwistOptions {
  std::string topic = "/cmd_vel";
  double rate_hz = 50.0;
  double gain_per_s = 1.5;
  static Parameters<TwistOptions> parameters();
};

/// A joint that is not planned, and is kept where the robot's profile has it.
struct HeldJoint {
  std::string joint;
  double position = 0.0;
  static Parameters<HeldJoint> parameters();
};

/// Of the base, in the world's frame.
struct KeepInBox {
  std::vector<double> lower_m;
  std::vector<double> upper_m;
  static Parameters<KeepInBox> parameters();
};

/// What else must be well for the robot to move.
struct WatchOptions {
  double max_joint_age_s = 0.2;
  double max_odometry_age_s = 0.2;
  double controller_silence_s = 0.5;
  double master_silence_s = 2.5;
  double clock_tolerance_s = 0.1;
  std::optional<std::string> stop_topic;
  bool stop_value = true;
  std::optional<std::string> battery_topic;
  double min_battery = 0.1;
  static Parameters<WatchOptions> parameters();
};

/// The map, as RViz is shown it.
struct MapMarkerOptions {
  std::string voxels_topic = "/sidestep/voxels";
  std::string slice_topic = "/sidestep/field_slice";
  double slice_height_m = 0.3;
  double rate_hz = 1.0;
  static Parameters<MapMarkerOptions> parameters();
};

/// What RViz is shown.
struct MarkerOptions {
  std::string topic = "/sidestep/markers";
  double rate_hz = 5.0;
  std::optional<std::string> link;
  MapMarkerOptions map;
  static Parameters<MarkerOptions> parameters();
};

/// Where goals come from while the robot runs, and where whoever sent them hears of them. Of those
/// on which something comes, an empty topic is not listened to.
struct GoalOptions {
  std::string base_pose_topic = "/move_base_simple/goal";
  std::string end_effector_topic = "/sidestep/goal/end_effector";
  std::string end_effector_link = "hand_palm_link";
  bool end_effector_turns = true;
  std::string joints_topic = "/sidestep/goal/joints";
  std::string pose_topic = "/sidestep/goal/pose";
  std::string cancel_topic = "/sidestep/goal/cancel";
  std::string feedback_topic = "/sidestep/goal/feedback";
  std::string result_topic = "/sidestep/goal/result";
  std::vector<std::string> tf_topics{"/tf"};
  std::vector<std::string> tf_static_topics{"/tf_static"};
  double tf_wait_s = 0.5;
  double tf_max_gap_s = 0.2;
  static Parameters<GoalOptions> parameters();
};

struct Options {
  std::string mode = "shadow";
  std::string confirm_topic = "/sidestep/confirm";
  std::string world_frame = "odom";
  std::vector<std::string> joint_state_topics{"/hsrb/joint_states"};
  std::optional<OdometryOptions> odometry;
  std::vector<ControllerEntry> controllers;
  std::optional<TwistOptions> twist;
  std::vector<HeldJoint> hold;
  double command_rate_hz = 20.0;
  double command_horizon_s = 1.0;
  double command_renewal_s = 0.25;
  double start_tolerance = 0.1;
  double velocity_tolerance = 0.05;
  double acceleration_fraction = 1.0;
  double assumed_ramp_s = 0.5;
  double connect_wait_s = 5.0;
  std::optional<KeepInBox> keep_in;
  std::optional<GoalOptions> goals;
  WatchOptions watch;
  MarkerOptions markers;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// A robot behind ROS 1. Waits for the master and a first state of all joints. Fails with
/// kUnsupported where the run has no robot, with kConfig where robot and options do not fit, with
/// kNotFound where no master or no state is there in time.
[[nodiscard]] Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::ros1_executor
