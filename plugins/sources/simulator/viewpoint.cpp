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

/// Pan and tilt move the camera a little as they turn it: a few rounds until it looks where it
/// should.
constexpr int kRounds = 5;
constexpr double kTurn_rad = 2.0 * std::numbers::pi;

/// By how much `from` has to turn about `axis` to lie as `to` does; 0 where either is along it.
double turn_about(const Eigen::Vector3d& axis, const Eigen::Vector3d& from,
                  const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from - axis * axis.dot(from);
  const Eigen::Vector3d b = to - axis * axis.dot(to);
  if (a.norm() < 1e-6 || b.norm() < 1e-6) return 0.0;
  return std::atan2(axis.dot(a.cross(b)), a.dot(b));
}

/// The angle within the limits that points the same way, that nearest to `now`; else the limit
/// nearest to pointing there.
double within(double angle_rad, double lower_rad, double upper_rad, double now_rad) {
  double best = angle_rad;
  double least = std::numeric_limits<double>::infinity();
  for (const int turns : {-1, 0, 1}) {
    const double same = std::remainder(angle_rad, kTurn_rad) + turns * kTurn_rad;
    const double clamped = std::clamp(same, lower_rad, upper_rad);
    // Pointing there counts for more than any way to it.
    const double badness = 1e3 * std::abs(clamped - same) + std::abs(clamped - now_rad);
    if (badness < least) {
      least = badness;
      best = clamped;
    }
  }
  return best;
}

/// A base slower than this does not move anywhere.
constexpr double kRest_mps = 0.02;
/// Over which a direction of motion is told.
constexpr double kMoment_s = 1e-3;

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

Result<Head> Head::create(std::shared_ptr<const RobotModel> robot, const HeadOptions& options,
                          const Eye& eye) {
  const auto* tree = dynamic_cast<const KinematicTree*>(robot.get());
  if (tree == nullptr) {
    return fail(
        ErrorCode::kUnsupported,
        "robot '" + robot->description().name + "' does not tell its joints, its head cannot turn",
        {}, "mount: {head: {look: fixed}}");
  }
  Head head(std::move(robot), *tree, eye);
  auto pan =
      SIDESTEP_TRY(head.find_axis(options.pan_joint, options.pan_lower_rad, options.pan_upper_rad));
  auto tilt = SIDESTEP_TRY(
      head.find_axis(options.tilt_joint, options.tilt_lower_rad, options.tilt_upper_rad));
  if (pan.link == tilt.link || !head.carries(pan.link, tilt.link) ||
      !head.carries(tilt.link, eye.link)) {
    return fail(ErrorCode::kConfig, "'" + options.pan_joint + "' does not carry '" +
                                        options.tilt_joint + "', or that not the camera's link");
  }
  head.pan_ = pan;
  head.tilt_ = tilt;
  head.speed_radps_ = options.speed_radps;
  return head;
}

Result<Head::Axis> Head::find_axis(const std::string& joint, double lower_rad,
                                   double upper_rad) const {
  std::vector<std::string> names;
  const auto& joints = tree_->tree_joints();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (joints[i].name == joint && joints[i].motion == TreeJoint::Motion::kRotation) {
      if (joints[i].joint < 0) {
        return Axis{static_cast<int>(i), lower_rad, upper_rad, joints[i].offset};
      }
      return fail(ErrorCode::kConfig, "joint '" + joint + "' is planned, a head cannot turn it");
    }
    if (joints[i].motion == TreeJoint::Motion::kRotation) names.push_back(joints[i].name);
  }
  return fail(ErrorCode::kConfig,
              "robot '" + tree_->description().name + "' has no joint '" + joint + "' that turns",
              {}, did_you_mean(joint, names));
}

bool Head::carries(int link, int carried) const {
  const auto& links = tree_->description().links;
  while (carried >= 0 && carried != link) carried = links[static_cast<std::size_t>(carried)].parent;
  return carried == link;
}

void Head::place(double pan_rad, double tilt_rad, std::span<Transform> T_world_link) const {
  const auto& links = tree_->description().links;
  // Parents come before children: each is placed on one that has been. What is carried keeps its
  // place on its parent.
  std::vector<Transform> before(T_world_link.begin(), T_world_link.end());
  for (std::size_t i = static_cast<std::size_t>(pan_.link); i < links.size(); ++i) {
    if (!carries(pan_.link, static_cast<int>(i))) continue;
    const auto parent = static_cast<std::size_t>(links[i].parent);
    const TreeJoint& joint = tree_->tree_joints()[i];
    const bool is_pan = static_cast<int>(i) == pan_.link;
    if (is_pan || static_cast<int>(i) == tilt_.link) {
      T_world_link[i] = T_world_link[parent] * joint.T_parent_joint *
                        Eigen::AngleAxisd(is_pan ? pan_rad : tilt_rad, joint.axis);
    } else {
      T_world_link[i] = T_world_link[parent] * (before[parent].inverse() * before[i]);
    }
  }
}

void Head::turn(std::span<Transform> T_world_link) const {
  place(pan_.angle_rad, tilt_.angle_rad, T_world_link);
}

Transform Head::eye_pose(double pan_rad, double tilt_rad, std::span<const Transform> T_world_link,
                         Eigen::Vector3d& pan_axis, Eigen::Vector3d& tilt_axis) const {
  std::vector<Transform> poses(T_world_link.begin(), T_world_link.end());
  place(pan_rad, tilt_rad, poses);
  const auto axis = [&](const Axis& of) -> Eigen::Vector3d {
    const auto link = static_cast<std::size_t>(of.link);
    return poses[link].linear() * tree_->tree_joints()[link].axis;
  };
  pan_axis = axis(pan_);
  tilt_axis = axis(tilt_);
  return poses[static_cast<std::size_t>(eye_.link)] * eye_.T_link_camera;
}

void Head::look_at(const Eigen::Vector3d& p_world, std::span<const Transform> T_world_link,
                   Stamp stamp) {
  double pan_rad = pan_.angle_rad;
  double tilt_rad = tilt_.angle_rad;
  Eigen::Vector3d pan_axis, tilt_axis;
  for (int round = 0; round < kRounds; ++round) {
    Transform eye = eye_pose(pan_rad, tilt_rad, T_world_link, pan_axis, tilt_axis);
    pan_rad =
        within(pan_rad + turn_about(pan_axis, eye.linear().col(2), p_world - eye.translation()),
               pan_.lower_rad, pan_.upper_rad, pan_.angle_rad);
    eye = eye_pose(pan_rad, tilt_rad, T_world_link, pan_axis, tilt_axis);
    tilt_rad =
        within(tilt_rad + turn_about(tilt_axis, eye.linear().col(2), p_world - eye.translation()),
               tilt_.lower_rad, tilt_.upper_rad, tilt_.angle_rad);
  }
  turn_towards(pan_rad, tilt_rad, stamp);
}

void Head::look_along(const Eigen::Vector3d& direction_world,
                      std::span<const Transform> T_world_link, Stamp stamp) {
  Eigen::Vector3d pan_axis, tilt_axis;
  const Transform eye =
      eye_pose(pan_.angle_rad, tilt_.angle_rad, T_world_link, pan_axis, tilt_axis);
  const double turn_rad = turn_about(pan_axis, eye.linear().col(2), direction_world);
  turn_towards(within(pan_.angle_rad + turn_rad, pan_.lower_rad, pan_.upper_rad, pan_.angle_rad),
               tilt_.angle_rad, stamp);
}

void Head::turn_towards(double pan_rad, double tilt_rad, Stamp stamp) {
  const double time_s = turned_at_ ? static_cast<double>(stamp.ns - turned_at_->ns) * 1e-9 : 0.0;
  const double most_rad = speed_radps_ * std::max(0.0, time_s);
  pan_.angle_rad += std::clamp(pan_rad - pan_.angle_rad, -most_rad, most_rad);
  tilt_.angle_rad += std::clamp(tilt_rad - tilt_.angle_rad, -most_rad, most_rad);
  rest(stamp);
}

SeenRobot::SeenRobot(std::shared_ptr<const RobotModel> robot, int hidden)
    : robot_(std::move(robot)) {
  const std::vector<CollisionShape>& shapes = robot_->description().shapes;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    if (shapes[i].link != hidden) seen_.push_back(static_cast<int>(i));
  }
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
  options_ = options.head;
  const auto link = SIDESTEP_TRY(find_link(options.link));
  eye_ = {link, transform_from_xyz_rpy(options.xyz_m, options.rpy_rad)};
  seen_.emplace(robot_, link);
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
  seen_->place(T_world_link_, view);
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
  if (fixed_) return fixed_->view(stamp, frame);
  const Transform pose = path_.T_world_camera(stamp.seconds());
  return View{pose, pose, {}, {}};
}

Stamp Viewpoint::known_until() const {
  if (motion_ == nullptr) return {std::numeric_limits<std::int64_t>::max()};
  return motion_->newest().value_or(Stamp{std::numeric_limits<std::int64_t>::min()});
}

std::vector<OptionMistake> check_mount(const MountOptions& mount) {
  std::vector<OptionMistake> mistakes;
  const HeadOptions& head = mount.head;
  if (head.pan_lower_rad > head.pan_upper_rad) {
    mistakes.push_back({{"mount.head.pan_lower_rad", "mount.head.pan_upper_rad"},
                        "must not be above pan_upper_rad",
                        {}});
  }
  if (head.tilt_lower_rad > head.tilt_upper_rad) {
    mistakes.push_back({{"mount.head.tilt_lower_rad", "mount.head.tilt_upper_rad"},
                        "must not be above tilt_upper_rad",
                        {}});
  }
  return mistakes;
}

}  // namespace sidestep::simulator
