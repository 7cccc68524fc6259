#include "viewpoint_feed.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sidestep::ros1_source {

Result<ViewpointFeed> ViewpointFeed::create(const Options& options,
                                            std::shared_ptr<const RobotModel> robot) {
  ViewpointFeed feed;
  feed.options_ = options;
  feed.robot_ = std::move(robot);
  if (options.joints) {
    SIDESTEP_TRY(feed.find_joints());
  }
  return feed;
}

Result<void> ViewpointFeed::find_joints() {
  if (robot_ == nullptr) {
    return fail(ErrorCode::kConfig, "source.joints is set, but the run has no robot");
  }
  const RobotDescription& robot = robot_->description();
  std::vector<int> of_base;
  if (options_.joints->base) {
    const BaseOptions& base = *options_.joints->base;
    for (const std::string* name : {&base.x_joint, &base.y_joint, &base.yaw_joint}) {
      const auto index = robot.joint_index(*name);
      if (!index) {
        return fail(ErrorCode::kConfig, "robot '" + robot.name + "' has no joint '" + *name + "'",
                    "source.joints.base");
      }
      of_base.push_back(*index);
    }
    base_ = BaseJoints{of_base[0], of_base[1], of_base[2]};
  }
  for (int j = 0; j < robot.dof(); ++j) {
    if (std::ranges::find(of_base, j) == of_base.end()) told_.push_back(j);
  }
  return {};
}

void ViewpointFeed::add(const ros_messages::TfMessage& message, bool is_static) {
  ros_messages::add_transforms(message, is_static, tf_);
}

void ViewpointFeed::add(const ros_messages::JointState& message) {
  ros_messages::add_joint_states(message, joints_);
}

tl::expected<Eigen::VectorXd, ros_messages::LookupFailure> ViewpointFeed::joints_at(
    Stamp stamp) const {
  const RobotDescription& robot = robot_->description();
  Eigen::VectorXd q(robot.dof());
  for (const int j : told_) {
    q[j] = SIDESTEP_TRY(joints_.position(robot.joints[static_cast<std::size_t>(j)], stamp,
                                         options_.joints->max_gap_s));
  }
  if (!base_) return q;
  const auto T_world_base = SIDESTEP_TRY(
      tf_.lookup(options_.world_frame, options_.joints->base->frame, stamp, options_.tf_max_gap_s));
  q[base_->x] = T_world_base.translation().x();
  q[base_->y] = T_world_base.translation().y();
  q[base_->yaw] = std::atan2(T_world_base.linear()(1, 0), T_world_base.linear()(0, 0));
  return q;
}

tl::expected<Viewpoint, ros_messages::LookupFailure> ViewpointFeed::at(
    Stamp stamp, const std::string& camera_frame) const {
  Viewpoint viewpoint;
  const auto T_world_camera =
      SIDESTEP_TRY(tf_.lookup(options_.world_frame, camera_frame, stamp, options_.tf_max_gap_s));
  viewpoint.T_world_camera = T_world_camera;
  if (!options_.joints) return viewpoint;
  viewpoint.joint_positions = SIDESTEP_TRY(joints_at(stamp));
  return viewpoint;
}

void ViewpointFeed::forget_before(Stamp stamp) {
  tf_.forget_before(stamp);
  joints_.forget_before(stamp);
}

}  // namespace sidestep::ros1_source
