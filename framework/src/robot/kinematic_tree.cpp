#include <sidestep/robot/kinematic_tree.hpp>

#include <algorithm>
#include <cmath>
#include <new>
#include <type_traits>

#include "robot_check.hpp"
#include "sines.hpp"

namespace sidestep {
namespace {

std::size_t at(int index) { return static_cast<std::size_t>(index); }

/// A rotation that takes z to `axis`; exact where the axis is one of the frame's own.
Eigen::Matrix3d turn_z_to(const Eigen::Vector3d& axis) {
  int least = 0;
  axis.cwiseAbs().minCoeff(&least);
  Eigen::Matrix3d R;
  R.col(2) = axis;
  R.col(0) = (Eigen::Vector3d::Unit(least) - axis(least) * axis).normalized();
  R.col(1) = R.col(2).cross(R.col(0));
  return R;
}

/// R * Rz of an angle with sine s and cosine c.
Eigen::Matrix3d turned_about_z(const Eigen::Matrix3d& R, double s, double c) {
  Eigen::Matrix3d turned;
  turned.col(0) = c * R.col(0) + s * R.col(1);
  turned.col(1) = c * R.col(1) - s * R.col(0);
  turned.col(2) = R.col(2);
  return turned;
}

}  // namespace

Result<std::unique_ptr<KinematicTree>> KinematicTree::create(RobotDescription description,
                                                             std::vector<TreeJoint> tree_joints) {
  if (auto ok = detail::check_robot(description, tree_joints); !ok) {
    return tl::make_unexpected(std::move(ok.error()));
  }
  return std::unique_ptr<KinematicTree>(
      new KinematicTree(std::move(description), std::move(tree_joints)));
}

KinematicTree::KinematicTree(RobotDescription description, std::vector<TreeJoint> tree_joints)
    : description_(std::move(description)), tree_joints_(std::move(tree_joints)) {
  for (std::size_t link = 0; link < tree_joints_.size(); ++link) add_link(link);

  for (const CollisionSphere& sphere : description_.spheres) {
    const Pose& T_body_link = T_body_link_[at(sphere.link)];
    spheres_.push_back(
        {body_of_link_[at(sphere.link)], T_body_link.R * sphere.centre_link_m + T_body_link.p});
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    movers_begin_.push_back(static_cast<int>(movers_.size()));
    for (int body = static_cast<int>(b); body != -1; body = bodies_[at(body)].parent) {
      if (bodies_[at(body)].joint != -1) movers_.push_back(body);
    }
  }
  movers_begin_.push_back(static_cast<int>(movers_.size()));
}

void KinematicTree::add_link(std::size_t link) {
  const TreeJoint& joint = tree_joints_[link];
  const int parent_link = description_.links[link].parent;
  const int parent_body = parent_link == -1 ? -1 : body_of_link_[at(parent_link)];
  const Pose T_body_parent = parent_link == -1
                                 ? Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()}
                                 : T_body_link_[at(parent_link)];

  Pose joint_pose{T_body_parent.R * joint.T_parent_joint.linear(),
                  T_body_parent.R * joint.T_parent_joint.translation() + T_body_parent.p};
  const bool moves = joint.motion != TreeJoint::Motion::kFixed && joint.joint != -1;
  if (!moves && joint.motion == TreeJoint::Motion::kTranslation)
    joint_pose.p += joint.offset * (joint_pose.R * joint.axis);
  if (!moves && joint.motion == TreeJoint::Motion::kRotation)
    joint_pose.R *= Eigen::AngleAxisd(joint.offset, joint.axis).toRotationMatrix();

  if (moves || link == 0) {
    const Eigen::Matrix3d turn = turn_z_to(moves ? joint.axis : Eigen::Vector3d::UnitZ());
    bodies_.push_back({.parent = parent_body,
                       .motion = moves ? joint.motion : TreeJoint::Motion::kFixed,
                       .joint = moves ? joint.joint : -1,
                       .multiplier = joint.multiplier,
                       .offset = joint.offset,
                       .R_parent_joint = joint_pose.R * turn,
                       .p_parent_joint = joint_pose.p});
    body_of_link_.push_back(static_cast<int>(bodies_.size()) - 1);
    T_body_link_.push_back({turn.transpose(), Eigen::Vector3d::Zero()});
  } else {
    body_of_link_.push_back(parent_body);
    T_body_link_.push_back(joint_pose);
  }
}

std::span<KinematicTree::Pose> KinematicTree::take_poses(Scratch::Scope& scope) const {
  static_assert(sizeof(Pose) == 12 * sizeof(double) && alignof(Pose) <= 64 &&
                std::is_trivially_destructible_v<Pose>);
  const std::span<double> room = scope.doubles(12 * bodies_.size());
  Pose* poses = reinterpret_cast<Pose*>(room.data());
  std::uninitialized_default_construct_n(poses, bodies_.size());
  return {poses, bodies_.size()};
}

void KinematicTree::place_bodies(const double* q, std::span<Pose> bodies) const noexcept {
  constexpr std::size_t kAtOnce = detail::kAngles;
  double values[kAtOnce], sines[kAtOnce], cosines[kAtOnce];  // of a run of bodies
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (b % kAtOnce == 0) {
      for (std::size_t i = 0; i < kAtOnce; ++i) {
        const Body* at_i = b + i < bodies_.size() ? &bodies_[b + i] : nullptr;
        const bool moves = at_i != nullptr && at_i->joint != -1;
        values[i] = moves ? at_i->multiplier * q[at_i->joint] + at_i->offset : 0.0;
      }
      detail::sines_and_cosines(values, sines, cosines);
    }
    const Body& body = bodies_[b];
    Pose& pose = bodies[b];
    if (body.parent == -1) {
      pose = {body.R_parent_joint, body.p_parent_joint};
    } else {
      const Pose& parent = bodies[at(body.parent)];
      pose.R.noalias() = parent.R * body.R_parent_joint;
      pose.p = parent.R * body.p_parent_joint + parent.p;
    }
    if (body.joint == -1) continue;
    if (body.motion == TreeJoint::Motion::kRotation) {
      pose.R = turned_about_z(pose.R, sines[b % kAtOnce], cosines[b % kAtOnce]);
    } else {
      pose.p += values[b % kAtOnce] * pose.R.col(2);
    }
  }
}

void KinematicTree::link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                               Scratch& scratch) const {
  if (q.size() < at(description_.dof())) return;
  Scratch::Scope scope(scratch);
  const std::span<Pose> bodies = take_poses(scope);
  place_bodies(q.data(), bodies);
  const std::size_t links = std::min(T_world_link.size(), body_of_link_.size());
  for (std::size_t i = 0; i < links; ++i) {
    const Pose& body = bodies[at(body_of_link_[i])];
    T_world_link[i].setIdentity();
    T_world_link[i].linear().noalias() = body.R * T_body_link_[i].R;
    T_world_link[i].translation() = body.R * T_body_link_[i].p + body.p;
  }
}

void KinematicTree::sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                                   Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  if (count == 0) return;
  const std::size_t n = std::min(q.size() / at(description_.dof()), centres_m.size() / count);
  Scratch::Scope scope(scratch);
  const std::span<Pose> bodies = take_poses(scope);
  for (std::size_t row = 0; row < n; ++row) {
    place_bodies(q.data() + row * at(description_.dof()), bodies);
    Eigen::Vector3d* centres = centres_m.data() + row * count;
    for (std::size_t s = 0; s < count; ++s) {
      const Pose& body = bodies[at(spheres_[s].body)];
      centres[s] = body.R * spheres_[s].p_body + body.p;
    }
  }
}

void KinematicTree::sphere_jacobians(std::span<const double> q,
                                     std::span<Eigen::Vector3d> centres_m,
                                     std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  const std::size_t dof = at(description_.dof());
  if (count == 0) return;
  const std::size_t n =
      std::min({q.size() / dof, centres_m.size() / count, jacobians.size() / (count * dof)});
  Scratch::Scope scope(scratch);
  const std::span<Pose> bodies = take_poses(scope);
  std::fill_n(jacobians.begin(), n * count * dof, Eigen::Vector3d::Zero());
  for (std::size_t row = 0; row < n; ++row) {
    place_bodies(q.data() + row * dof, bodies);
    for (std::size_t s = 0; s < count; ++s) {
      const std::size_t b = at(spheres_[s].body);
      const Eigen::Vector3d centre = bodies[b].R * spheres_[s].p_body + bodies[b].p;
      centres_m[row * count + s] = centre;
      Eigen::Vector3d* columns = jacobians.data() + (row * count + s) * dof;
      for (int m = movers_begin_[b]; m < movers_begin_[b + 1]; ++m) {
        const std::size_t mover = at(movers_[at(m)]);
        const Body& body = bodies_[mover];
        const Eigen::Vector3d axis = bodies[mover].R.col(2);
        // d(centre)/d(value): the axis, or axis x arm; a mimic joint adds to its master's column.
        columns[body.joint] += body.multiplier * (body.motion == TreeJoint::Motion::kRotation
                                                      ? axis.cross(centre - bodies[mover].p).eval()
                                                      : axis);
      }
    }
  }
}

void KinematicTree::pull_back(std::span<const double> q,
                              std::span<const Eigen::Vector3d> sphere_gradients,
                              std::span<double> joint_gradients, Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  const std::size_t dof = at(description_.dof());
  std::size_t n = std::min(q.size(), joint_gradients.size()) / dof;
  if (count > 0) n = std::min(n, sphere_gradients.size() / count);
  std::fill_n(joint_gradients.begin(), n * dof, 0.0);

  Scratch::Scope scope(scratch);
  const std::span<Pose> bodies = take_poses(scope);
  // Per body, as in statics: the force at the spheres it carries, and its moment about the origin.
  const std::span<double> wrenches = scope.doubles(6 * bodies_.size());
  using Column = Eigen::Map<Eigen::Vector3d>;
  for (std::size_t row = 0; row < n; ++row) {
    place_bodies(q.data() + row * dof, bodies);
    std::ranges::fill(wrenches, 0.0);
    for (std::size_t s = 0; s < count; ++s) {
      const std::size_t b = at(spheres_[s].body);
      const Eigen::Vector3d& gradient = sphere_gradients[row * count + s];
      const Eigen::Vector3d centre = bodies[b].R * spheres_[s].p_body + bodies[b].p;
      Column(&wrenches[6 * b]) += gradient;
      Column(&wrenches[6 * b + 3]) += centre.cross(gradient);
    }
    for (std::size_t b = bodies_.size(); b-- > 0;) {
      const Body& body = bodies_[b];
      const Column force(&wrenches[6 * b]);
      const Column moment(&wrenches[6 * b + 3]);
      if (body.joint != -1) {
        const Eigen::Vector3d axis = bodies[b].R.col(2);
        joint_gradients[row * dof + at(body.joint)] +=
            body.multiplier * (body.motion == TreeJoint::Motion::kRotation
                                   ? axis.dot(moment - bodies[b].p.cross(force))
                                   : axis.dot(force));
      }
      if (body.parent == -1) continue;
      Column(&wrenches[6 * at(body.parent)]) += force;
      Column(&wrenches[6 * at(body.parent) + 3]) += moment;
    }
  }
}

}  // namespace sidestep
