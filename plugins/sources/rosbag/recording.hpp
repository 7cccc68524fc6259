#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/sensing/frame.hpp>

#include "bag.hpp"
#include "joint_history.hpp"
#include "options.hpp"
#include "rigid_pose.hpp"
#include "tf_tree.hpp"
#include "time_series.hpp"

namespace sidestep::rosbag {

/// An image or a cloud that is to become a frame.
struct Measurement {
  Stamp stamp;
  MessageRef ref;
};

/// Poses that the messages of a topic tell.
struct PoseTrack {
  std::string reference_frame;  ///< Of the first message.
  ros_messages::TimeSeries<ros_messages::RigidPose> poses;
};

/// What a pass over a bag leaves in memory: everything that is named in the options but images and
/// clouds, of which it has the places.
struct Recording {
  bool is_cloud = false;
  std::vector<Measurement> measurements;  ///< By stamp.
  /// What the camera info says, where it changes.
  ros_messages::TimeSeries<CameraIntrinsics> cameras;
  bool is_distorted = false;
  ros_messages::TfTree tf;
  PoseTrack camera_track;  ///< Of pose.topic.
  PoseTrack base_track;    ///< Of joints.base.topic.
  ros_messages::JointHistory joints;
};

/// Reads all of a bag but its images and clouds. Logs what of it is unusable, by topic. Fails with
/// kConfig where a topic that is named is not in the bag, or has messages of another type, with
/// kIo where the bag is damaged and nothing can be read of the measurements.
[[nodiscard]] Result<Recording> read_recording(Bag& bag, const Options& options, Log& log);

}  // namespace sidestep::rosbag
