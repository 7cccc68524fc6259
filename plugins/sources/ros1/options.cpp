#include "options.hpp"

namespace sidestep::ros1_source {

Parameters<BaseOptions> BaseOptions::parameters() {
  using B = BaseOptions;
  return ros_messages::base_joint_parameters<B>().add("frame", &B::frame,
                                                      "The base's frame in tf.");
}

Parameters<JointOptions> JointOptions::parameters() {
  using J = JointOptions;
  return Parameters<J>()
      .add("topics", &J::topics, "Topics of sensor_msgs/JointState.")
      .add("max_gap_s", &J::max_gap_s,
           "Longest time between two positions of a joint that are interpolated.",
           {.unit = "s", .min = 0.0})
      .add("base", &J::base, "Joints that tf tells of; absent: joint states tell of all.");
}

Parameters<Options> Options::parameters() {
  using O = Options;
  return Parameters<O>()
      .add("topic", &O::topic,
           "sensor_msgs/Image, rectified, of 16UC1 (mm) or 32FC1 (m), or sensor_msgs/PointCloud2.")
      .add("measures", &O::measures, "What the topic's messages are.",
           {.choices = {"depth_image", "point_cloud"}})
      .add("camera_info_topic", &O::camera_info_topic,
           "sensor_msgs/CameraInfo of the depth image; not used with point clouds.")
      .add("points_in", &O::points_in,
           "Point clouds: whether z of their frame goes into the scene (optical), or x (forward).",
           {.choices = {"optical", "forward"}})
      .add("depth_min_m", &O::depth_min_m, "Depths below count as no return.",
           {.unit = "m", .min = 0.0})
      .add("depth_max_m", &O::depth_max_m, "Depths beyond count as no return.",
           {.unit = "m", .min = 0.0})
      .add("world_frame", &O::world_frame,
           "The frame of tf that is the map's world; with executor ros1, its world_frame.")
      .add("camera_frame", &O::camera_frame,
           "The camera's optical frame; null: what each message's header says.")
      .add("tf_topics", &O::tf_topics, "Topics of tf2_msgs/TFMessage.")
      .add("tf_static_topics", &O::tf_static_topics,
           "Topics of transforms that hold for all times.")
      .add("tf_max_gap_s", &O::tf_max_gap_s,
           "Longest time between two transforms that are interpolated.", {.unit = "s", .min = 0.0})
      .add("sync_wait_s", &O::sync_wait_s,
           "How long tf and joint states may come later than the frame that they are needed for.",
           {.unit = "s", .min = 0.0, .max = 10.0})
      .add("max_frame_age_s", &O::max_frame_age_s, "An older frame is dropped.",
           {.unit = "s", .min = 0.01})
      .add("max_speed_mps", &O::max_speed_mps,
           "A frame to which the camera would have moved faster is dropped: tf jumped.",
           {.unit = "m/s", .min = 0.0})
      .add("max_turn_radps", &O::max_turn_radps, "So is one to which it would have turned faster.",
           {.unit = "rad/s", .min = 0.0})
      .add("clock_tolerance_s", &O::clock_tolerance_s,
           "A change of the distance between ROS time and the run's clock beyond this is a jump; "
           "so is a frame that is farther ahead.",
           {.unit = "s", .min = 0.001})
      .add("connect_wait_s", &O::connect_wait_s,
           "How long the master and a first frame with its pose are waited for.",
           {.unit = "s", .min = 0.0, .max = 600.0})
      .add("joints", &O::joints,
           "Where the robot's joints are, for mappers that leave the robot itself out; absent: not "
           "told.");
}

std::vector<OptionMistake> Options::check() const {
  std::vector<OptionMistake> mistakes;
  if (depth_min_m >= depth_max_m) {
    mistakes.push_back({{"depth_min_m", "depth_max_m"}, "must be less than depth_max_m", {}});
  }
  if (tf_topics.empty() && tf_static_topics.empty()) {
    mistakes.push_back({{"tf_topics"}, "is empty, and tf_static_topics is, too", {}});
  }
  if (joints && joints->topics.empty()) {
    mistakes.push_back({{"joints"}, "has no topics", {}});
  }
  return mistakes;
}

}  // namespace sidestep::ros1_source
