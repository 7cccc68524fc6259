#include "head.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

namespace sidestep::simulator {
namespace {

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

}  // namespace

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

}  // namespace sidestep::simulator
