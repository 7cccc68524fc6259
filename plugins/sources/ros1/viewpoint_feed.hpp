#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <tl/expected.hpp>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "conversions.hpp"
#include "ros1_source.hpp"

namespace sidestep::ros1_source {

/// Where the camera and the robot were when a frame was taken.
struct Viewpoint {
  Transform T_world_camera = Transform::Identity();
  std::optional<Eigen::VectorXd> joint_positions;
};

/// Where camera and robot are, by messages of tf and joint states as they come. All stamps are
/// ROS's. One thread at a time.
class ViewpointFeed {
 public:
  /// `robot` may be null where the options ask for no joints. Fails with kConfig where it is
  /// needed, or lacks a joint.
  [[nodiscard]] static Result<ViewpointFeed> create(const Options& options,
                                                    std::shared_ptr<const RobotModel> robot);

  void add(const ros_messages::TfMessage& message, bool is_static);
  void add(const ros_messages::JointState& message);

  /// What is known of a time. Fails with the reason; one that is LookupFault::kTooLate, kUnknown
  /// or kNotConnected may pass with the next message.
  [[nodiscard]] tl::expected<Viewpoint, ros_messages::LookupFailure> at(
      Stamp stamp, const std::string& camera_frame) const;

  /// Forgets what is only of use before `stamp`.
  void forget_before(Stamp stamp);

 private:
  struct BaseJoints {
    int x = 0;
    int y = 0;
    int yaw = 0;
  };
  ViewpointFeed() = default;
  Result<void> find_joints();
  [[nodiscard]] tl::expected<Eigen::VectorXd, ros_messages::LookupFailure> joints_at(
      Stamp stamp) const;

  Options options_;
  std::shared_ptr<const RobotModel> robot_;
  std::vector<int> told_;  ///< Joints that joint states tell of.
  std::optional<BaseJoints> base_;
  ros_messages::TfTree tf_;
  ros_messages::JointHistory joints_;
};

}  // namespace sidestep::ros1_source
