#include "mounted_camera.hpp"

#include <span>
#include <string>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep::simulator {
namespace {

/// A base slower than this does not move anywhere.
constexpr double kRest_mps = 0.02;
/// Over which a direction of motion is told.
constexpr double kMoment_s = 1e-3;

}  // namespace

Result<MountedCamera> MountedCamera::create(const MountOptions& options,
                                            const HostContext& context) {
  if (context.robot == nullptr || context.motion == nullptr) {
    return fail(ErrorCode::kUnsupported,
                "a camera cannot be mounted on the robot: no robot moves in this experiment", {},
                "use camera_path");
  }
  MountedCamera camera;
  camera.robot_ = context.robot;
  camera.motion_ = context.motion;
  SIDESTEP_TRY(camera.mount(options));
  return camera;
}

Result<void> MountedCamera::mount(const MountOptions& options) {
  const RobotDescription& robot = robot_->description();
  options_ = options.head;
  const auto link = SIDESTEP_TRY(find_link(options.link));
  eye_ = {link, transform_from_xyz_rpy(options.xyz_m, options.rpy_rad)};
  for (std::size_t i = 0; i < robot.shapes.size(); ++i) {
    if (robot.shapes[i].link != link) seen_.push_back(static_cast<int>(i));
  }
  T_world_link_.resize(robot.links.size());
  T_world_link_later_.resize(robot.links.size());
  if (options_.look == "fixed") return {};

  const bool is_ahead = options_.look == "ahead";
  const auto target = SIDESTEP_TRY(find_link(is_ahead ? options_.ahead_link : options_.base_link));
  (is_ahead ? ahead_link_ : base_link_) = target;
  head_ = SIDESTEP_TRY(Head::create(robot_, options_, eye_));
  return {};
}

Result<int> MountedCamera::find_link(const std::string& name) const {
  const RobotDescription& robot = robot_->description();
  if (const auto index = robot.link_index(name)) return *index;
  std::vector<std::string> names;
  for (const Link& link : robot.links) names.push_back(link.name);
  return fail(ErrorCode::kConfig, "robot '" + robot.name + "' has no link '" + name + "'", {},
              did_you_mean(name, names));
}

std::vector<SceneObject> MountedCamera::shapes() const {
  const RobotDescription& robot = robot_->description();
  std::vector<SceneObject> objects;
  for (const int index : seen_) {
    const CollisionShape& shape = robot.shapes[idx(index)];
    objects.push_back(
        {robot.name + "/" + robot.links[idx(shape.link)].name, shape.shape, {Waypoint{}}});
  }
  return objects;
}

void MountedCamera::place(const Eigen::VectorXd& q, std::vector<Transform>& T_world_link) {
  robot_->link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link, scratch_);
}

std::optional<View> MountedCamera::view(Stamp stamp) {
  const auto measured = motion_->measured(stamp);
  const auto truth = motion_->truth(stamp);
  if (!measured || !truth) return {};
  const auto eye = static_cast<std::size_t>(eye_.link);
  View view;
  view.joint_positions = measured->q;
  place(measured->q, T_world_link_);
  if (head_) {
    aim(*measured, stamp);
    head_->turn(T_world_link_);
  }
  view.T_world_camera = T_world_link_[eye] * eye_.T_link_camera;

  place(truth->q, T_world_link_);
  if (head_) head_->turn(T_world_link_);
  view.T_world_eye = T_world_link_[eye] * eye_.T_link_camera;
  for (const int index : seen_) {
    const CollisionShape& shape = robot_->description().shapes[idx(index)];
    view.T_world_shape.push_back(T_world_link_[idx(shape.link)] * shape.T_link_shape);
  }
  return view;
}

void MountedCamera::aim(const RobotState& measured, Stamp stamp) {
  if (options_.look == "along_motion") return follow_motion(measured, stamp);
  const auto later = motion_->planned({stamp.ns + Stamp::from_seconds(options_.ahead_s).ns});
  place(later ? later->q : measured.q, T_world_link_later_);
  head_->look_at(T_world_link_later_[idx(ahead_link_)].translation(), T_world_link_, stamp);
}

void MountedCamera::follow_motion(const RobotState& measured, Stamp stamp) {
  place(measured.q + kMoment_s * measured.qdot, T_world_link_later_);
  const auto base = static_cast<std::size_t>(base_link_);
  Eigen::Vector3d velocity =
      (T_world_link_later_[base].translation() - T_world_link_[base].translation()) / kMoment_s;
  velocity.z() = 0.0;
  if (velocity.norm() < kRest_mps) return head_->rest(stamp);
  head_->look_along(velocity, T_world_link_, stamp);
}

}  // namespace sidestep::simulator
