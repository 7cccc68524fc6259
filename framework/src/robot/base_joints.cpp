#include <sidestep/robot/base_joints.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <sidestep/core/index.hpp>
#include "configurations.hpp"

namespace sidestep {
namespace {

/// Whether moving these joints moves all that has a shape as one: tried on a few configurations.
bool moves_all(const RobotModel& robot, const BaseJoints& base) {
  const RobotDescription& description = robot.description();
  Scratch scratch;
  std::vector<Transform> before(description.links.size()), after(description.links.size());
  for (const double share : {0.0, 0.37, 0.81}) {
    std::vector<double> q = configuration_at(description, share);
    robot.link_poses(q, before, scratch);
    const Transform T = transform_from_xyz_rpy({0.3, -0.2, 0.0}, {0.0, 0.0, 0.4});
    base.move(T, q);
    robot.link_poses(q, after, scratch);
    const auto moves = [&](int link) {
      return after[idx(link)].isApprox(T * before[idx(link)], 1e-9);
    };
    if (!std::ranges::all_of(description.spheres, moves, &CollisionSphere::link)) return false;
    if (!std::ranges::all_of(description.shapes, moves, &CollisionShape::link)) return false;
  }
  return true;
}

}  // namespace

Result<BaseJoints> BaseJoints::of(const RobotModel& robot) {
  const RobotDescription& description = robot.description();
  if (const auto along = description.planar_base()) {
    for (int yaw = 0; yaw < description.dof(); ++yaw) {
      if (description.joints[idx(yaw)].type == Joint::Type::kPrismatic) continue;
      BaseJoints base((*along)[0], (*along)[1], yaw);
      if (moves_all(robot, base)) return base;
    }
  }
  return fail(ErrorCode::kUnsupported,
              "robot '" + description.name + "' has no base that moves and turns in the plane");
}

void BaseJoints::move(const Transform& T_new_old, std::span<double> q) const noexcept {
  const Eigen::Vector3d p = T_new_old * Eigen::Vector3d(q[idx(x_)], q[idx(y_)], 0.0);
  q[idx(x_)] = p.x();
  q[idx(y_)] = p.y();
  q[idx(yaw_)] += yaw_of(T_new_old);
}

void BaseJoints::turn(const Transform& T_new_old, std::span<double> qdot) const noexcept {
  const Eigen::Vector3d v = T_new_old.linear() * Eigen::Vector3d(qdot[idx(x_)], qdot[idx(y_)], 0.0);
  qdot[idx(x_)] = v.x();
  qdot[idx(y_)] = v.y();
}

double yaw_of(const Transform& transform) noexcept {
  return std::atan2(transform.linear()(1, 0), transform.linear()(0, 0));
}

}  // namespace sidestep
