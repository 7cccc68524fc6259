#include <sidestep/robot/head.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include <sidestep/core/index.hpp>

namespace sidestep {
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
double within(double angle_rad, const Joint& limits, double now_rad) {
  double best = angle_rad;
  double least = std::numeric_limits<double>::infinity();
  for (const int turns : {-1, 0, 1}) {
    const double same = std::remainder(angle_rad, kTurn_rad) + turns * kTurn_rad;
    const double clamped = std::clamp(same, limits.lower, limits.upper);
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

Result<Head> Head::create(std::shared_ptr<const RobotModel> robot) {
  const std::string name = "robot '" + robot->description().name + "'";
  if (!robot->description().head) {
    return fail(ErrorCode::kUnsupported, name + " has no head that turns", {},
                "a profile says so: head: {pan_joint, tilt_joint, camera_link}");
  }
  const auto* tree = dynamic_cast<const KinematicTree*>(robot.get());
  if (tree != nullptr) return Head(std::move(robot), *tree);
  return fail(ErrorCode::kUnsupported, name + " does not tell its joints, its head cannot turn");
}

Head::Head(std::shared_ptr<const RobotModel> robot, const KinematicTree& tree)
    : robot_(std::move(robot)) {
  const auto axis_of = [&](const HeadDescription::Axis& axis, double& rest_rad) {
    const TreeJoint& joint = tree.tree_joints()[idx(axis.link)];
    rest_rad = joint.offset;
    const int parent = tree.description().links[idx(axis.link)].parent;
    return Axis{idx(axis.link), idx(parent), joint.T_parent_joint, joint.axis};
  };
  pan_ = axis_of(description().pan, rest_.pan_rad);
  tilt_ = axis_of(description().tilt, rest_.tilt_rad);
  camera_ = idx(description().camera_link);
  const std::vector<Link>& links = robot_->description().links;
  carriers_.resize(links.size(), Carrier::kBody);
  for (std::size_t i = pan_.link; i < links.size(); ++i) {  // parents come before children
    if (i == pan_.link) {
      carriers_[i] = Carrier::kPan;
    } else if (i == tilt_.link) {
      carriers_[i] = Carrier::kTilt;
    } else if (links[i].parent >= 0) {
      carriers_[i] = carriers_[idx(links[i].parent)];
    }
  }
}

HeadAngles Head::within_limits(const HeadAngles& angles) const noexcept {
  const Joint& pan = description().pan.joint;
  const Joint& tilt = description().tilt.joint;
  return {std::clamp(angles.pan_rad, pan.lower, pan.upper),
          std::clamp(angles.tilt_rad, tilt.lower, tilt.upper)};
}

Head::Chain Head::chain(const HeadAngles& angles, std::span<const Transform> T_world_link) const {
  const auto turned = [](const Axis& axis, const Transform& T_world_parent, double angle_rad) {
    return T_world_parent * axis.T_parent_joint * Eigen::AngleAxisd(angle_rad, axis.axis);
  };
  const auto carried = [&](std::size_t by, std::size_t link) {
    return T_world_link[by].inverse() * T_world_link[link];
  };
  Chain chain;
  chain.T_world_pan = turned(pan_, T_world_link[pan_.parent], angles.pan_rad);
  const Transform T_world_parent = chain.T_world_pan * carried(pan_.link, tilt_.parent);
  chain.T_world_tilt = turned(tilt_, T_world_parent, angles.tilt_rad);
  chain.T_world_camera = chain.T_world_tilt * carried(tilt_.link, camera_);
  return chain;
}

void Head::place(const HeadAngles& angles, std::span<Transform> T_world_link) const {
  const Chain turned = chain(angles, T_world_link);
  const Transform by_pan = turned.T_world_pan * T_world_link[pan_.link].inverse();
  const Transform by_tilt = turned.T_world_tilt * T_world_link[tilt_.link].inverse();
  for (std::size_t i = 0; i < carriers_.size(); ++i) {
    if (carriers_[i] == Carrier::kPan) T_world_link[i] = by_pan * T_world_link[i];
    if (carriers_[i] == Carrier::kTilt) T_world_link[i] = by_tilt * T_world_link[i];
  }
}

Transform Head::T_world_camera(const HeadAngles& angles,
                               std::span<const Transform> T_world_link) const {
  return chain(angles, T_world_link).T_world_camera;
}

HeadAngles Head::towards(const Eigen::Vector3d& p_world, std::span<const Transform> T_world_link,
                         const HeadAngles& from) const {
  HeadAngles angles = from;
  const auto turn = [&](double& angle_rad, const Transform& T_world_axis, const Axis& axis,
                        const Transform& eye, const Joint& limits, double from_rad) {
    const double turn_rad = turn_about(T_world_axis.linear() * axis.axis, eye.linear().col(2),
                                       p_world - eye.translation());
    angle_rad = within(angle_rad + turn_rad, limits, from_rad);
  };
  for (int round = 0; round < kRounds; ++round) {
    const Chain panned = chain(angles, T_world_link);
    turn(angles.pan_rad, panned.T_world_pan, pan_, panned.T_world_camera, description().pan.joint,
         from.pan_rad);
    const Chain tilted = chain(angles, T_world_link);
    turn(angles.tilt_rad, tilted.T_world_tilt, tilt_, tilted.T_world_camera,
         description().tilt.joint, from.tilt_rad);
  }
  return angles;
}

}  // namespace sidestep
