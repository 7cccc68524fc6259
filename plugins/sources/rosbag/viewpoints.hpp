#pragma once

#include <memory>
#include <optional>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "options.hpp"
#include "recording.hpp"

namespace sidestep::rosbag {

/// Where the camera and the robot were, by what a bag tells. Immutable; [any] thread.
class Viewpoints {
 public:
  /// Borrows the recording. `robot` may be null where the options ask for no joints. Fails with
  /// kConfig where, of all the bag tells, no pose or joint position can come: frames that tf does
  /// not know or connect, with `measured_in` for the measurements' frame; joints that no message
  /// tells of.
  [[nodiscard]] static Result<Viewpoints> create(const Recording& recording, const Options& options,
                                                 std::shared_ptr<const RobotModel> robot,
                                                 const std::string& measured_in,
                                                 const std::string& file);

  /// Fails with kBadFrame where what is known around `stamp` is missing or too far apart.
  [[nodiscard]] Result<Transform> T_world_camera(const std::string& measured_in, Stamp stamp) const;

  /// In the order of the robot's joints; nothing where the options ask for none. Fails likewise.
  [[nodiscard]] Result<std::optional<Eigen::VectorXd>> joint_positions(Stamp stamp) const;

 private:
  struct BaseJoints {
    int x = 0;
    int y = 0;
    int yaw = 0;
  };
  Viewpoints(const Recording& recording, const Options& options,
             std::shared_ptr<const RobotModel> robot);
  Result<void> find_joints(const std::string& file);
  [[nodiscard]] Result<Transform> T_world_base(Stamp stamp) const;
  [[nodiscard]] Result<Transform> in_tf(const std::string& frame, Stamp stamp,
                                        double max_gap_s) const;

  const Recording* recording_;
  PoseOptions pose_;
  std::optional<JointOptions> joints_;
  std::shared_ptr<const RobotModel> robot_;
  Transform T_world_reference_;
  Transform T_body_camera_;
  std::vector<Joint> told_;      ///< Joints by messages.
  std::vector<int> told_index_;  ///< Their places in the robot's order.
  Eigen::VectorXd fixed_;        ///< All joints; those that are fixed are set.
  std::optional<BaseJoints> base_;
};

}  // namespace sidestep::rosbag
