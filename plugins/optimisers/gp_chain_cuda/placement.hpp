#pragma once

#include "chain_problem.hpp"

namespace sidestep::gp_chain_cuda {

/// R Rz(angle).
SIDESTEP_HOST_DEVICE inline Mat3 turned_about_z(const Mat3& R, double angle) {
  const double s = sin(angle), c = cos(angle);
  return {c * R.x + s * R.y, c * R.y - s * R.x, R.z};
}

/// Places all bodies of a robot in one configuration, world frame.
SIDESTEP_HOST_DEVICE inline void place_bodies(const ChainProblem& problem, const double* q,
                                              Pose* bodies) {
  for (int b = 0; b < problem.bodies; ++b) {
    const Body& body = problem.body[b];
    Pose pose = body.T_parent_joint;
    if (body.parent >= 0) {
      const Pose& parent = bodies[body.parent];
      pose = {parent.R * pose.R, parent.R * pose.p + parent.p};
    }
    if (body.joint >= 0) {
      const double value = body.multiplier * q[body.joint] + body.offset;
      if (body.motion == Motion::kRotation) {
        pose.R = turned_about_z(pose.R, value);
      } else {
        pose.p = pose.p + value * pose.R.z;
      }
    }
    bodies[b] = pose;
  }
}

/// Maps a force on a body onto joints, as RobotModel::pull_back(). `moment`: about the world's
/// origin. row: one number a joint.
SIDESTEP_HOST_DEVICE inline void pull_back(const ChainProblem& problem, const Pose* bodies,
                                           int body, const Vec3& force, const Vec3& moment,
                                           double* row) {
  for (int j = 0; j < problem.dof; ++j) row[j] = 0.0;
  for (int b = body; b >= 0; b = problem.body[b].parent) {
    const Body& mover = problem.body[b];
    if (mover.joint < 0) continue;
    const Pose& pose = bodies[b];
    const double work = mover.motion == Motion::kRotation
                            ? dot(pose.R.z, moment - cross(pose.p, force))
                            : dot(pose.R.z, force);
    row[mover.joint] += mover.multiplier * work;
  }
}

}  // namespace sidestep::gp_chain_cuda
