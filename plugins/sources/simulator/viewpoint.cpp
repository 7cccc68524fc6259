#include "viewpoint.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <sidestep/core/index.hpp>

namespace sidestep::simulator {
namespace {

constexpr double kNowhere_m = 1e-6;

/// From the body of a camera, x forward and z up, to its optical frame (REP-103).
Eigen::Matrix3d R_body_optical() {
  Eigen::Matrix3d rotation;
  rotation << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return rotation;
}

Eigen::Quaterniond body_orientation(const Eigen::Vector3d& rpy_rad) {
  return Eigen::Quaterniond(transform_from_xyz_rpy(Eigen::Vector3d::Zero(), rpy_rad).linear());
}

/// A spline through one vector of each waypoint.
template <class Value>
Eigen::Vector3d hermite(const std::vector<CameraWaypoint>& waypoints, std::size_t from,
                        double time_s, Value&& value) {
  const auto time = [&](std::size_t i) { return waypoints[i].time_s; };
  const auto velocity = [&](std::size_t i) -> Eigen::Vector3d {
    if (i == 0 || i + 1 == waypoints.size()) return Eigen::Vector3d::Zero();
    return (value(i + 1) - value(i - 1)) / (time(i + 1) - time(i - 1));
  };
  const double h = time(from + 1) - time(from);
  const double s = (time_s - time(from)) / h;
  const double s2 = s * s;
  const double s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * value(from) + (s3 - 2 * s2 + s) * h * velocity(from) +
         (3 * s2 - 2 * s3) * value(from + 1) + (s3 - s2) * h * velocity(from + 1);
}

}  // namespace

Transform look_at(const Eigen::Vector3d& position_m, const Eigen::Vector3d& look_at_m) {
  const Eigen::Vector3d forward = (look_at_m - position_m).normalized();
  Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ());
  if (right.norm() < kNowhere_m) {
    right = forward.cross(Eigen::Vector3d(-std::copysign(1.0, forward.z()), 0.0, 0.0));
  }
  right.normalize();
  Transform pose = Transform::Identity();
  pose.translation() = position_m;
  pose.linear() << right, forward.cross(right), forward;
  return pose;
}

std::vector<OptionMistake> check_camera_path(const std::vector<CameraWaypoint>& waypoints) {
  std::vector<OptionMistake> mistakes;
  if (waypoints.empty()) mistakes.push_back({{"camera_path"}, "needs a waypoint", {}});
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const CameraWaypoint& waypoint = waypoints[i];
    const std::string name = "camera_path[" + std::to_string(i) + "]";
    if (i > 0 && waypoint.time_s <= waypoints[i - 1].time_s) {
      mistakes.push_back({{name + ".time_s"}, "must be greater than the one before", {}});
    }
    if (waypoint.look_at_m.has_value() == waypoint.rpy_rad.has_value()) {
      mistakes.push_back({{name}, "needs either look_at_m or rpy_rad", {}});
    } else if (waypoint.look_at_m.has_value() != waypoints[0].look_at_m.has_value()) {
      mistakes.push_back(
          {{name}, "and camera_path[0] must both have look_at_m or both rpy_rad", {}});
    }
    if (waypoint.look_at_m && (*waypoint.look_at_m - waypoint.position_m).norm() < kNowhere_m) {
      mistakes.push_back({{name + ".look_at_m"}, "is where the camera itself is", {}});
    }
  }
  return mistakes;
}

std::vector<OptionMistake> check_fixed_cameras(const std::vector<FixedCamera>& cameras) {
  std::vector<OptionMistake> mistakes;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if ((cameras[i].look_at_m - cameras[i].position_m).norm() < kNowhere_m) {
      mistakes.push_back({{"fixed_cameras[" + std::to_string(i) + "].look_at_m"},
                          "is where the camera itself is",
                          {}});
    }
  }
  return mistakes;
}

Transform CameraPath::T_world_camera(double time_s) const {
  const double first_s = waypoints_.front().time_s;
  const double last_s = waypoints_.back().time_s;
  if (repeats_ && time_s > last_s && last_s > first_s) {
    time_s = first_s + std::fmod(time_s - first_s, last_s - first_s);
  }
  time_s = std::clamp(time_s, first_s, last_s);
  const auto after = std::ranges::upper_bound(waypoints_, time_s, {}, &CameraWaypoint::time_s);
  const auto from = static_cast<std::size_t>(after - waypoints_.begin()) - 1;
  const bool at_end = from + 1 == waypoints_.size();
  const CameraWaypoint& begin = waypoints_[from];

  const Eigen::Vector3d position_m =
      at_end ? begin.position_m : hermite(waypoints_, from, time_s, [&](std::size_t i) {
        return waypoints_[i].position_m;
      });
  if (begin.look_at_m) {
    return look_at(position_m, at_end ? *begin.look_at_m
                                      : hermite(waypoints_, from, time_s,
                                                [&](auto i) { return *waypoints_[i].look_at_m; }));
  }
  Eigen::Quaterniond orientation = body_orientation(*begin.rpy_rad);
  if (!at_end) {
    const CameraWaypoint& end = waypoints_[from + 1];
    orientation = orientation.slerp((time_s - begin.time_s) / (end.time_s - begin.time_s),
                                    body_orientation(*end.rpy_rad));
  }
  Transform pose = Transform::Identity();
  pose.translation() = position_m;
  pose.linear() = orientation.toRotationMatrix() * R_body_optical();
  return pose;
}

SeenRobot::SeenRobot(std::shared_ptr<const RobotModel> robot, int hidden)
    : robot_(std::move(robot)) {
  const std::vector<CollisionShape>& shapes = robot_->description().shapes;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (shapes[i].link != hidden) seen_.push_back(static_cast<int>(i));
  }
}

void SeenRobot::look_out_of(std::span<const Transform> T_world_link,
                            const Eigen::Vector3d& sensor_m) {
  std::erase_if(seen_, [&](int index) {
    const CollisionShape& shape = robot_->description().shapes[idx(index)];
    const Transform T_world_shape = T_world_link[idx(shape.link)] * shape.T_link_shape;
    return signed_distance_m(shape.shape, T_world_shape.inverse() * sensor_m) < 0.0;
  });
}

std::vector<SceneObject> SeenRobot::shapes() const {
  const RobotDescription& robot = robot_->description();
  std::vector<SceneObject> objects;
  for (const int index : seen_) {
    const CollisionShape& shape = robot.shapes[idx(index)];
    objects.push_back(
        {robot.name + "/" + robot.links[idx(shape.link)].name, shape.shape, {Waypoint{}}});
  }
  return objects;
}

void SeenRobot::place(std::span<const Transform> T_world_link, View& view) const {
  for (const int index : seen_) {
    const CollisionShape& shape = robot_->description().shapes[idx(index)];
    view.T_world_shape.push_back(T_world_link[idx(shape.link)] * shape.T_link_shape);
  }
}

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
  link_ = SIDESTEP_TRY(find_link(options.link));
  T_link_camera_ = transform_from_xyz_rpy(options.xyz_m, options.rpy_rad);
  seen_.emplace(robot_, link_);
  T_world_link_.resize(robot.links.size());
  if (robot.head) head_ = SIDESTEP_TRY(Head::create(robot_));
  place(Eigen::VectorXd::Zero(robot.dof()), head_ ? head_->rest() : HeadAngles{});
  seen_->look_out_of(T_world_link_, (T_world_link_[idx(link_)] * T_link_camera_).translation());
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

void MountedCamera::place(const Eigen::VectorXd& q, const HeadAngles& head) {
  robot_->link_poses(as_span(q), T_world_link_, scratch_);
  if (head_) head_->place(head, T_world_link_);
}

std::optional<View> MountedCamera::view(Stamp stamp) {
  const auto measured = motion_->measured(stamp);
  const auto truth = motion_->truth(stamp);
  if (!measured || !truth) return {};
  HeadAngles head;
  if (head_) head = motion_->head(stamp).value_or(head_->rest());
  View view;
  view.joint_positions = measured->q;
  place(measured->q, head);
  view.T_world_camera = T_world_link_[idx(link_)] * T_link_camera_;
  place(truth->q, head);
  view.T_world_eye = T_world_link_[idx(link_)] * T_link_camera_;
  seen_->place(T_world_link_, view);
  return view;
}

FixedCameras::FixedCameras(const std::vector<FixedCamera>& cameras, const HostContext& context) {
  for (const FixedCamera& camera : cameras) {
    T_world_camera_.push_back(look_at(camera.position_m, camera.look_at_m));
  }
  if (context.robot == nullptr || context.motion == nullptr) return;
  model_ = context.robot;
  motion_ = context.motion;
  robot_.emplace(model_, -1);
  T_world_link_.resize(model_->description().links.size());
}

std::optional<View> FixedCameras::view(Stamp stamp, std::int64_t frame) {
  const Transform& pose = T_world_camera_[idx(frame) % T_world_camera_.size()];
  View view{pose, pose, {}, {}};
  if (!robot_) return view;
  const auto measured = motion_->measured(stamp);
  const auto truth = motion_->truth(stamp);
  if (!measured || !truth) return {};
  view.joint_positions = measured->q;
  model_->link_poses({truth->q.data(), idx(truth->q.size())}, T_world_link_, scratch_);
  robot_->place(T_world_link_, view);
  return view;
}

Result<Viewpoint> Viewpoint::create(const Options& options, const HostContext& context) {
  Viewpoint viewpoint(CameraPath(options.camera_path, options.camera_path_repeats));
  if (options.mount) {
    viewpoint.mounted_ = SIDESTEP_TRY(MountedCamera::create(*options.mount, context));
  } else if (!options.fixed_cameras.empty()) {
    viewpoint.fixed_.emplace(options.fixed_cameras, context);
  }
  // Paths and fixed cameras look along the optical axis; a laser's frame has x there.
  if (options.laser) viewpoint.T_optical_sensor_ = T_forward_optical().inverse();
  if (viewpoint.robot() != nullptr) viewpoint.motion_ = context.motion;
  return viewpoint;
}

const SeenRobot* Viewpoint::robot() const {
  if (mounted_) return &mounted_->robot();
  return fixed_ ? fixed_->robot() : nullptr;
}

std::vector<SceneObject> Viewpoint::shapes() const {
  return robot() != nullptr ? robot()->shapes() : std::vector<SceneObject>{};
}

std::optional<View> Viewpoint::view(Stamp stamp, std::int64_t frame) {
  if (mounted_) return mounted_->view(stamp);
  std::optional<View> view;
  if (fixed_) {
    view = fixed_->view(stamp, frame);
  } else {
    const Transform pose = path_.T_world_camera(stamp.seconds());
    view = View{pose, pose, {}, {}};
  }
  if (!view) return {};
  view->T_world_camera = view->T_world_camera * T_optical_sensor_;
  view->T_world_eye = view->T_world_eye * T_optical_sensor_;
  return view;
}

Stamp Viewpoint::known_until() const {
  if (motion_ == nullptr) return {std::numeric_limits<std::int64_t>::max()};
  return motion_->newest().value_or(Stamp{std::numeric_limits<std::int64_t>::min()});
}

}  // namespace sidestep::simulator
