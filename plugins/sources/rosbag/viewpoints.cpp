#include "viewpoints.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

namespace sidestep::rosbag {
namespace {

using ros_messages::LookupFailure;
using ros_messages::LookupFault;

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

tl::unexpected<Error> dropped(const LookupFailure& failure) {
  return fail(ErrorCode::kBadFrame, failure.message);
}

Result<Transform> along(const PoseTrack& track, const std::string& topic, Stamp stamp,
                        double max_gap_s) {
  const auto bracket = track.poses.around(stamp, max_gap_s);
  if (bracket) {
    return interpolate(bracket->before->value, bracket->after->value, bracket->share).transform();
  }
  switch (bracket.error()) {
    case LookupFault::kTooEarly:
      return fail(ErrorCode::kBadFrame, "the poses on " + topic + " begin later");
    case LookupFault::kTooLate:
      return fail(ErrorCode::kBadFrame, "the poses on " + topic + " end earlier");
    default:
      return fail(ErrorCode::kBadFrame,
                  "the poses on " + topic + " have a gap longer than max_gap_s");
  }
}

}  // namespace

Viewpoints::Viewpoints(const Recording& recording, const Options& options,
                       std::shared_ptr<const RobotModel> robot)
    : recording_(&recording),
      pose_(options.pose),
      joints_(options.joints),
      robot_(std::move(robot)),
      T_world_reference_(product(options.pose.T_world_reference)),
      T_body_camera_(product(options.pose.T_body_camera)) {}

Result<Viewpoints> Viewpoints::create(const Recording& recording, const Options& options,
                                      std::shared_ptr<const RobotModel> robot,
                                      const std::string& measured_in, const std::string& file) {
  Viewpoints viewpoints(recording, options, std::move(robot));
  const auto check_path = [&](const std::string& frame) -> Result<void> {
    const auto missing = recording.tf.missing_path(options.pose.world_frame, frame);
    if (!missing) return {};
    return fail(ErrorCode::kConfig, missing->message, file,
                "frames of the bag that have no parent: " + joined(recording.tf.roots()));
  };
  if (options.pose.from == "tf") {
    auto checked = check_path(options.pose.camera_frame.value_or(measured_in));
    if (checked && options.joints && options.joints->base) {
      const BaseOptions& base = *options.joints->base;
      checked = check_path(base.from == "tf" ? base.frame : recording.base_track.reference_frame);
    }
    if (!checked) return error_of(checked);
  }
  if (options.joints) {
    SIDESTEP_TRY(viewpoints.find_joints(file));
  }
  return viewpoints;
}

Result<void> Viewpoints::find_joints(const std::string& file) {
  if (robot_ == nullptr) {
    return fail(ErrorCode::kConfig, "source.joints is set, but the run has no robot");
  }
  const RobotDescription& robot = robot_->description();
  fixed_ = Eigen::VectorXd::Zero(robot.dof());
  std::set<int> elsewhere;  // Joints that messages need not tell of.
  std::vector<std::string> unknown;
  const auto index = [&](const std::string& name) {
    const auto found = robot.joint_index(name);
    if (!found) unknown.push_back(name);
    if (found) elsewhere.insert(*found);
    return found.value_or(0);
  };
  for (const FixedJoint& joint : joints_->fixed) fixed_[index(joint.joint)] = joint.position;
  if (joints_->base) {
    base_ = BaseJoints{index(joints_->base->x_joint), index(joints_->base->y_joint),
                       index(joints_->base->yaw_joint)};
  }
  if (!unknown.empty()) {
    return fail(ErrorCode::kConfig,
                "robot '" + robot.name + "' has no joint " + joined(unknown) +
                    ", which source.joints names",
                file);
  }
  for (int i = 0; i < robot.dof(); ++i) {
    if (elsewhere.contains(i)) continue;
    told_.push_back(robot.joints[static_cast<std::size_t>(i)]);
    told_index_.push_back(i);
  }
  const std::vector<std::string> missing = recording_->joints.missing(told_);
  if (missing.empty()) return {};
  return fail(ErrorCode::kConfig,
              "no message on " + joined(joints_->topics) + " tells of joint " + joined(missing) +
                  " of robot '" + robot.name + "'",
              file,
              "they tell of " + joined(recording_->joints.names()) +
                  "; joints.fixed and joints.base are for others");
}

Result<Transform> Viewpoints::in_tf(const std::string& frame, Stamp stamp, double max_gap_s) const {
  auto found = recording_->tf.lookup(pose_.world_frame, frame, stamp, max_gap_s);
  if (!found) return dropped(found.error());
  return *found;
}

Result<Transform> Viewpoints::T_world_camera(const std::string& measured_in, Stamp stamp) const {
  auto told = pose_.from == "tf"
                  ? in_tf(pose_.camera_frame.value_or(measured_in), stamp, pose_.max_gap_s)
                  : along(recording_->camera_track, *pose_.topic, stamp, pose_.max_gap_s);
  if (!told) return told;
  if (pose_.inverse) told = told->inverse();
  return T_world_reference_ * *told * T_body_camera_;
}

Result<Transform> Viewpoints::T_world_base(Stamp stamp) const {
  const BaseOptions& base = *joints_->base;
  const double max_gap_s = joints_->max_gap_s;
  if (base.from == "tf") return in_tf(base.frame, stamp, max_gap_s);
  auto told = along(recording_->base_track, *base.topic, stamp, max_gap_s);
  if (!told || pose_.from != "tf") return told;
  const auto placed = SIDESTEP_TRY(in_tf(recording_->base_track.reference_frame, stamp, max_gap_s));
  return placed * *told;
}

Result<std::optional<Eigen::VectorXd>> Viewpoints::joint_positions(Stamp stamp) const {
  if (!joints_) return std::optional<Eigen::VectorXd>();
  Eigen::VectorXd positions = fixed_;
  for (std::size_t i = 0; i < told_.size(); ++i) {
    const auto position = recording_->joints.position(told_[i], stamp, joints_->max_gap_s);
    if (!position) return dropped(position.error());
    positions[told_index_[i]] = *position;
  }
  if (base_) {
    const auto told = SIDESTEP_TRY(T_world_base(stamp));
    const Transform T_world_base = T_world_reference_ * told;
    positions[base_->x] = T_world_base.translation().x();
    positions[base_->y] = T_world_base.translation().y();
    positions[base_->yaw] = std::atan2(T_world_base.linear()(1, 0), T_world_base.linear()(0, 0));
  }
  return std::optional<Eigen::VectorXd>(std::move(positions));
}

}  // namespace sidestep::rosbag
