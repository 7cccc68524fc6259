#include "ros1_executor.hpp"

#include <algorithm>
#include <set>

namespace sidestep::ros1_executor {

Parameters<OdometryOptions> OdometryOptions::parameters() {
  using O = OdometryOptions;
  return ros_messages::base_joint_parameters<O>()
      .add("topic", &O::topic, "nav_msgs/Odometry of the base, in world_frame.")
      .add("twist_in", &O::twist_in,
           "The frame of the message's twist: the base's own, as REP 105 has it, or the world's.",
           {.choices = {"base", "world"}});
}

Parameters<ControllerEntry> ControllerEntry::parameters() {
  using C = ControllerEntry;
  return Parameters<C>()
      .add("command_topic", &C::command_topic, "Takes trajectory_msgs/JointTrajectory.",
           {.required = true})
      .add("state_topic", &C::state_topic,
           "On which the controller says, in whatever type, that it is there; absent: not watched.")
      .add("joints", &C::joints,
           "That it moves, in its own order: the robot's, and those of `hold`.",
           {.required = true});
}

Parameters<TwistOptions> TwistOptions::parameters() {
  using T = TwistOptions;
  return Parameters<T>()
      .add("topic", &T::topic, "Takes geometry_msgs/Twist: speeds in the base's own frame.")
      .add("rate_hz", &T::rate_hz,
           "How often one is sent, while the base is told to move and for half a second after.",
           {.unit = "Hz", .min = 5.0, .max = 500.0})
      .add("gain_per_s", &T::gain_per_s,
           "With which the base is brought back, by odometry, to where it is told to be; well "
           "below a "
           "quarter of the inverse of its drives' delay and lag. 0: not.",
           {.unit = "1/s", .min = 0.0, .max = 5.0});
}

Parameters<HeldJoint> HeldJoint::parameters() {
  using H = HeldJoint;
  return Parameters<H>()
      .add("joint", &H::joint, "A controller's joint that is not planned.", {.required = true})
      .add("position", &H::position, "Where it is kept, m or rad: where the profile has it fixed.");
}

Parameters<KeepInBox> KeepInBox::parameters() {
  using K = KeepInBox;
  return Parameters<K>()
      .add("lower_m", &K::lower_m, "Least x and y of the base in world_frame.",
           {.unit = "m", .required = true})
      .add("upper_m", &K::upper_m, "Largest x and y of the base.", {.unit = "m", .required = true});
}

Parameters<WatchOptions> WatchOptions::parameters() {
  using W = WatchOptions;
  return Parameters<W>()
      .add("max_joint_age_s", &W::max_joint_age_s, "Joint states older than this stop the robot.",
           {.unit = "s", .min = 0.01})
      .add("max_odometry_age_s", &W::max_odometry_age_s, "So does odometry.",
           {.unit = "s", .min = 0.01})
      .add("controller_silence_s", &W::controller_silence_s,
           "So does a controller whose state topic was silent for so long.",
           {.unit = "s", .min = 0.01})
      .add("master_silence_s", &W::master_silence_s,
           "So does a master that did not answer for so long; 0: the master is not watched.",
           {.unit = "s", .min = 0.0})
      .add("clock_tolerance_s", &W::clock_tolerance_s,
           "A change of the distance between ROS time and the run's clock beyond this is a jump; "
           "so is a stamp that is farther ahead.",
           {.unit = "s", .min = 0.001})
      .add("stop_topic", &W::stop_topic,
           "std_msgs/Bool of an emergency stop, e.g. /hsrb/runstop_button; absent: not watched.")
      .add("stop_value", &W::stop_value, "What it says while the robot must not move.")
      .add("battery_topic", &W::battery_topic, "sensor_msgs/BatteryState; absent: not watched.")
      .add("min_battery", &W::min_battery, "Share of the battery below which the robot stops.",
           {.min = 0.0, .max = 1.0});
}

Parameters<MapMarkerOptions> MapMarkerOptions::parameters() {
  using M = MapMarkerOptions;
  return Parameters<M>()
      .add("voxels_topic", &M::voxels_topic,
           "visualization_msgs/MarkerArray: the occupied voxels, coloured by height.")
      .add("slice_topic", &M::slice_topic,
           "visualization_msgs/MarkerArray: distances on a plane, red where something is, blue far "
           "from all.")
      .add("slice_height_m", &M::slice_height_m, "Height of that plane in world_frame.",
           {.unit = "m", .min = -100.0, .max = 100.0})
      .add("rate_hz", &M::rate_hz, "How often both at most; 0: never.",
           {.unit = "Hz", .min = 0.0, .max = 10.0});
}

Parameters<GoalOptions> GoalOptions::parameters() {
  using G = GoalOptions;
  return Parameters<G>()
      .add("base_pose_topic", &G::base_pose_topic,
           "geometry_msgs/PoseStamped for the base, as RViz's 2D Nav Goal sends it. Topics that "
           "are empty are not listened to.")
      .add("end_effector_topic", &G::end_effector_topic,
           "geometry_msgs/PoseStamped for end_effector_link; the whole body goes where it must.")
      .add("end_effector_link", &G::end_effector_link, "Which link that is.")
      .add("end_effector_turns", &G::end_effector_turns,
           "Whether its orientation counts; otherwise any will do.")
      .add("joints_topic", &G::joints_topic,
           "sensor_msgs/JointState: positions by name; joints left out stay.")
      .add("pose_topic", &G::pose_topic, "std_msgs/String: a pose of the robot's profile.")
      .add("cancel_topic", &G::cancel_topic,
           "actionlib_msgs/GoalID: the robot stops, where the id is empty or its goal's.")
      .add("feedback_topic", &G::feedback_topic,
           "actionlib_msgs/GoalStatus: that a goal is taken, and how far there is to go.")
      .add("result_topic", &G::result_topic,
           "actionlib_msgs/GoalStatus: how a goal ended, and why; latched.")
      .add("tf_topics", &G::tf_topics,
           "Topics of tf2_msgs/TFMessage, for goals in other frames than world_frame.")
      .add("tf_static_topics", &G::tf_static_topics,
           "Topics of transforms that hold for all times.")
      .add("tf_wait_s", &G::tf_wait_s,
           "How long tf of a goal's stamp may come later than the goal.",
           {.unit = "s", .min = 0.0, .max = 10.0})
      .add("tf_max_gap_s", &G::tf_max_gap_s,
           "Longest time between two transforms that are interpolated.", {.unit = "s", .min = 0.0});
}

Parameters<MarkerOptions> MarkerOptions::parameters() {
  using M = MarkerOptions;
  return Parameters<M>()
      .add("topic", &M::topic, "visualization_msgs/MarkerArray: plan, robot and refused plans.")
      .add("rate_hz", &M::rate_hz, "How often at most; 0: none.",
           {.unit = "Hz", .min = 0.0, .max = 100.0})
      .add("link", &M::link, "Whose path the plan shows; absent: the robot's last link.")
      .add("map", &M::map, "The map; drawn off the planning threads, while somebody looks.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("mode", &O::mode,
           "shadow: commands nothing, and takes the plan for what the robot does; confirm: asks "
           "before the first motion after each standstill; drive: moves.",
           {.choices = {"shadow", "confirm", "drive"}})
      .add("confirm_topic", &O::confirm_topic,
           "std_msgs/Bool: true lets the motion that is shown begin.")
      .add("world_frame", &O::world_frame,
           "In which plans are made, and markers shown: the one that odometry and base controller "
           "speak of.")
      .add("joint_state_topics", &O::joint_state_topics, "sensor_msgs/JointState.")
      .add("odometry", &O::odometry, "Where the base is; absent: all joints are in joint states.")
      .add("controllers", &O::controllers, "Who moves which joints.")
      .add(
          "twist", &O::twist,
          "Drives the base, the joints of `odometry`, by speeds, in place of a controller; absent: "
          "not.")
      .add("hold", &O::hold, "Joints that controllers move but plans do not.")
      .add("command_rate_hz", &O::command_rate_hz,
           "Points of a command a second; controllers go between them by cubics, as plans do.",
           {.unit = "Hz", .min = 1.0, .max = 500.0})
      .add("command_horizon_s", &O::command_horizon_s,
           "How much motion one command holds before a stop along the plan's path: what the robot "
           "does if nobody commands it any more. 0: the whole plan.",
           {.unit = "s", .min = 0.0, .max = 60.0})
      .add("command_renewal_s", &O::command_renewal_s, "After which it is sent again, further on.",
           {.unit = "s", .min = 0.02, .max = 30.0})
      .add("start_tolerance", &O::start_tolerance,
           "A trajectory that begins farther than this from where a joint is to be is refused, m "
           "or rad.",
           {.min = 0.0})
      .add("velocity_tolerance", &O::velocity_tolerance,
           "So is one that is faster than a joint's limit by more than this share.", {.min = 0.0})
      .add(
          "acceleration_fraction", &O::acceleration_fraction,
          "Share of the limits of braking, the profile's or those of acceleration, that stops use.",
          {.min = 0.01, .max = 1.0})
      .add("assumed_ramp_s", &O::assumed_ramp_s,
           "A joint without a known acceleration limit reaches its largest velocity in this time.",
           {.unit = "s", .min = 1e-3})
      .add("connect_wait_s", &O::connect_wait_s,
           "How long the master and a first state of all joints are waited for.",
           {.unit = "s", .min = 0.0, .max = 600.0})
      .add("keep_in", &O::keep_in, "A trajectory whose base leaves this box is refused.")
      .add("goals", &O::goals,
           "Where goals come from in a run of type deploy; absent: from nowhere.")
      .add("watch", &O::watch, "What stops the robot.")
      .add("markers", &O::markers, "What RViz is shown.");
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (joint_state_topics.empty()) mistakes.push_back({{"joint_state_topics"}, "is empty", {}});
  if (mode != "shadow" && controllers.empty() && !twist) {
    mistakes.push_back({{"mode", "controllers"}, "needs controllers, and there are none", {}});
  }
  if (twist && !odometry) {
    mistakes.push_back({{"twist", "odometry"}, "needs odometry, whose joints it moves", {}});
  }
  std::set<std::string> moved;
  if (twist && odometry) moved = {odometry->x_joint, odometry->y_joint, odometry->yaw_joint};
  for (const ControllerEntry& controller : controllers) {
    for (const std::string& joint : controller.joints) {
      if (moved.insert(joint).second) continue;
      mistakes.push_back(
          {{"controllers"}, "move joint '" + joint + "', which something else moves, too", {}});
    }
  }
  for (const HeldJoint& held : hold) {
    if (moved.contains(held.joint)) continue;
    mistakes.push_back({{"hold", "controllers"},
                        "hold joint '" + held.joint + "', which no controller moves",
                        {}});
  }
  if (command_horizon_s > 0.0 && command_renewal_s >= command_horizon_s) {
    mistakes.push_back(
        {{"command_renewal_s", "command_horizon_s"}, "must be less than command_horizon_s", {}});
  }
  if (keep_in) {
    const bool is_plane = keep_in->lower_m.size() == 2 && keep_in->upper_m.size() == 2;
    if (!is_plane || !(keep_in->lower_m[0] < keep_in->upper_m[0]) ||
        !(keep_in->lower_m[1] < keep_in->upper_m[1])) {
      mistakes.push_back(
          {{"keep_in"}, "needs two values each, those of lower_m below those of upper_m", {}});
    }
    if (!odometry) {
      mistakes.push_back({{"keep_in", "odometry"}, "needs odometry, whose joints it bounds", {}});
    }
  }
  return mistakes;
}

}  // namespace sidestep::ros1_executor
