#include <sidestep/robot/kinematic_tree.hpp>

#include <algorithm>
#include <cmath>
#include <new>
#include <string>
#include <unordered_set>
#include <utility>

#include <sidestep/core/index.hpp>

#include "pose_lanes.hpp"
#include "sines.hpp"

namespace sidestep {
namespace {

constexpr double kUnitTolerance = 1e-9;

tl::unexpected<Error> refuse(std::string message, std::string where) {
  return fail(ErrorCode::kInvalidArgument, std::move(message), std::move(where));
}

bool in_range(int index, std::size_t size) { return index >= 0 && idx(index) < size; }

template <class Named>
Result<void> check_names(const std::vector<Named>& items, const char* what) {
  std::unordered_set<std::string_view> seen;
  for (const Named& item : items) {
    const std::string where = std::string(what) + " '" + item.name + "'";
    if (item.name.empty()) return refuse("has no name", std::string("a ") + what);
    if (!seen.insert(item.name).second) return refuse("the name is used twice", where);
  }
  return {};
}

Result<void> check_joint(const Joint& joint) {
  const std::string where = "joint '" + joint.name + "'";
  if (std::isnan(joint.lower) || std::isnan(joint.upper) || joint.lower > joint.upper)
    return refuse("the lower limit lies above the upper one", where);
  if (joint.type != Joint::Type::kContinuous &&
      (std::isinf(joint.lower) || std::isinf(joint.upper)))
    return refuse("only a continuous joint may be without limits", where);
  if (!(joint.max_velocity > 0.0) || std::isinf(joint.max_velocity))
    return refuse("the velocity limit must be positive", where);
  if (!(joint.max_acceleration > 0.0))
    return refuse("the acceleration limit must be positive", where);
  if (joint.max_braking && !(*joint.max_braking >= joint.max_acceleration))
    return refuse("the braking limit must not lie below the acceleration limit", where);
  if (joint.max_braking && std::isinf(*joint.max_braking))
    return refuse("the braking limit must be finite", where);
  return {};
}

Result<void> check_tree(const RobotDescription& description,
                        const std::vector<TreeJoint>& tree_joints) {
  if (description.links.empty()) return refuse("has no links", "robot '" + description.name + "'");
  if (tree_joints.size() != description.links.size())
    return refuse("needs one tree joint per link", "robot '" + description.name + "'");
  std::vector<bool> moved(description.joints.size(), false);
  for (std::size_t i = 0; i < tree_joints.size(); ++i) {
    const Link& link = description.links[i];
    const TreeJoint& joint = tree_joints[i];
    const std::string where = "link '" + link.name + "'";
    if ((i == 0) != (link.parent == -1))
      return refuse("the first link must be the only root", where);
    if (i > 0 && !in_range(link.parent, i)) return refuse("must come after its parent", where);
    if (!joint.T_parent_joint.matrix().allFinite()) return refuse("its pose is not finite", where);
    if (!joint.T_parent_joint.linear().isUnitary(kUnitTolerance))
      return refuse("its pose is not a rigid transform", where);
    if (!std::isfinite(joint.multiplier) || !std::isfinite(joint.offset))
      return refuse("its joint's multiplier and offset must be finite", where);
    if (joint.motion == TreeJoint::Motion::kFixed) continue;
    if (std::abs(joint.axis.norm() - 1.0) > kUnitTolerance)
      return refuse("its joint's axis is not of unit length", where);
    if (joint.joint == -1) continue;
    if (!in_range(joint.joint, moved.size())) return refuse("its joint does not exist", where);
    moved[idx(joint.joint)] = true;
  }
  for (std::size_t j = 0; j < moved.size(); ++j) {
    if (!moved[j]) return refuse("moves no link", "joint '" + description.joints[j].name + "'");
  }
  return {};
}

Result<void> check_parts(const RobotDescription& description) {
  const std::size_t links = description.links.size();
  const std::string robot = "robot '" + description.name + "'";
  for (const CollisionSphere& sphere : description.spheres) {
    if (!in_range(sphere.link, links))
      return refuse("a sphere is on a link that does not exist", robot);
    const std::string where = "link '" + description.links[idx(sphere.link)].name + "'";
    if (!(sphere.radius_m > 0.0) || std::isinf(sphere.radius_m))
      return refuse("a sphere's radius must be positive", where);
    if (!sphere.centre_link_m.allFinite()) return refuse("a sphere's centre is not finite", where);
  }
  for (const CollisionShape& shape : description.shapes) {
    if (!in_range(shape.link, links))
      return refuse("a shape is on a link that does not exist", robot);
  }
  for (const auto& [a, b] : description.self_collision_pairs) {
    if (!in_range(a, links) || !in_range(b, links) || a >= b)
      return refuse("a self-collision pair must name two links, the lower index first", robot);
  }
  for (const NamedPose& pose : description.poses) {
    if (pose.positions.size() != description.joints.size())
      return refuse("needs one entry per joint", "pose '" + pose.name + "'");
  }
  return {};
}

/// Whether a description and its tree joints fit together; names the first part that does not.
Result<void> check_robot(const RobotDescription& description,
                         const std::vector<TreeJoint>& tree_joints) {
  if (description.joints.empty())
    return refuse("has no planned joint", "robot '" + description.name + "'");
  SIDESTEP_TRY(check_names(description.joints, "joint"));
  SIDESTEP_TRY(check_names(description.links, "link"));
  SIDESTEP_TRY(check_names(description.poses, "pose"));
  for (const Joint& joint : description.joints) {
    SIDESTEP_TRY(check_joint(joint));
  }
  SIDESTEP_TRY(check_tree(description, tree_joints));
  return check_parts(description);
}

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

/// Makes every column of a rotation that is an axis up to rounding that axis, as after quarter
/// turns. Returns which axis each column is, counted from 1, negative if reversed; 0 for none.
std::array<std::int8_t, 3> snap_to_axes(Eigen::Matrix3d& R) {
  constexpr double kRounding = 1e-15;
  std::array<std::int8_t, 3> axes{};
  for (int column = 0; column < 3; ++column) {
    for (int axis = 0; axis < 3; ++axis) {
      const double sign = R(axis, column) < 0.0 ? -1.0 : 1.0;
      const Eigen::Vector3d exact = sign * Eigen::Vector3d::Unit(axis);
      if ((R.col(column) - exact).cwiseAbs().maxCoeff() > kRounding) continue;
      R.col(column) = exact;
      axes[idx(column)] = static_cast<std::int8_t>(sign * (axis + 1));
    }
  }
  return axes;
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
  SIDESTEP_TRY(check_robot(description, tree_joints));
  return std::unique_ptr<KinematicTree>(
      new KinematicTree(std::move(description), std::move(tree_joints)));
}

KinematicTree::KinematicTree(RobotDescription description, std::vector<TreeJoint> tree_joints)
    : description_(std::move(description)), tree_joints_(std::move(tree_joints)) {
  for (std::size_t link = 0; link < tree_joints_.size(); ++link) add_link(link);

  for (const CollisionSphere& sphere : description_.spheres) {
    const Pose& T_body_link = T_body_link_[idx(sphere.link)];
    spheres_.push_back(
        {body_of_link_[idx(sphere.link)], T_body_link.R * sphere.centre_link_m + T_body_link.p});
  }
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    movers_begin_.push_back(static_cast<int>(movers_.size()));
    for (int body = static_cast<int>(b); body != -1; body = bodies_[idx(body)].parent) {
      if (bodies_[idx(body)].joint != -1) movers_.push_back(body);
    }
  }
  movers_begin_.push_back(static_cast<int>(movers_.size()));
  add_columns();
}

/// A column of the table of screws for each joint, and further ones for bodies that share a joint.
void KinematicTree::add_columns() {
  for (int j = 0; j < description_.dof(); ++j) columns_.push_back({-1, j});
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const int joint = bodies_[b].joint;
    if (joint == -1) continue;
    if (columns_[idx(joint)].body == -1) {
      columns_[idx(joint)].body = static_cast<int>(b);
    } else {
      columns_.push_back({static_cast<int>(b), joint});
    }
  }
  const std::size_t stride = padded(columns_.size());
  weights_.assign_zeros(bodies_.size() * stride);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    for (int m = movers_begin_[b]; m < movers_begin_[b + 1]; ++m) {
      const int mover = movers_[idx(m)];
      const auto column = std::ranges::find(columns_, mover, &Column::body) - columns_.begin();
      weights_.data()[b * stride + idx(column)] = bodies_[idx(mover)].multiplier;
    }
  }
}

void KinematicTree::add_link(std::size_t link) {
  const TreeJoint& joint = tree_joints_[link];
  const int parent_link = description_.links[link].parent;
  const int parent_body = parent_link == -1 ? -1 : body_of_link_[idx(parent_link)];
  const Pose T_body_parent = parent_link == -1
                                 ? Pose{Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero()}
                                 : T_body_link_[idx(parent_link)];

  Pose joint_pose{T_body_parent.R * joint.T_parent_joint.linear(),
                  T_body_parent.R * joint.T_parent_joint.translation() + T_body_parent.p};
  const bool moves = joint.motion != TreeJoint::Motion::kFixed && joint.joint != -1;
  if (!moves && joint.motion == TreeJoint::Motion::kTranslation)
    joint_pose.p += joint.offset * (joint_pose.R * joint.axis);
  if (!moves && joint.motion == TreeJoint::Motion::kRotation)
    joint_pose.R *= Eigen::AngleAxisd(joint.offset, joint.axis).toRotationMatrix();

  if (moves || link == 0) {
    const Eigen::Matrix3d turn = turn_z_to(moves ? joint.axis : Eigen::Vector3d::UnitZ());
    Eigen::Matrix3d R_parent_joint = joint_pose.R * turn;
    const auto axes = snap_to_axes(R_parent_joint);
    bodies_.push_back({.parent = parent_body,
                       .motion = moves ? joint.motion : TreeJoint::Motion::kFixed,
                       .joint = moves ? joint.joint : -1,
                       .multiplier = joint.multiplier,
                       .offset = joint.offset,
                       .R_parent_joint = R_parent_joint,
                       .p_parent_joint = joint_pose.p,
                       .axes = axes});
    body_of_link_.push_back(static_cast<int>(bodies_.size()) - 1);
    T_body_link_.push_back({turn.transpose(), Eigen::Vector3d::Zero()});
  } else {
    body_of_link_.push_back(parent_body);
    T_body_link_.push_back(joint_pose);
  }
}

void KinematicTree::place_bodies(const double* q, std::span<Pose> bodies) const noexcept {
  constexpr std::size_t kAtOnce = detail::kAngles;
  double values[kAtOnce], sines[kAtOnce], cosines[kAtOnce];  // of a run of bodies
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    if (b % kAtOnce == 0) {
      for (std::size_t i = 0; i < kAtOnce; ++i) {
        const TreeBody* at_i = b + i < bodies_.size() ? &bodies_[b + i] : nullptr;
        const bool moves = at_i != nullptr && at_i->joint != -1;
        values[i] = moves ? at_i->multiplier * q[at_i->joint] + at_i->offset : 0.0;
      }
      detail::sines_and_cosines(values, sines, cosines);
    }
    const TreeBody& body = bodies_[b];
    Pose& pose = bodies[b];
    if (body.parent == -1) {
      pose = {body.R_parent_joint, body.p_parent_joint};
    } else {
      const Pose& parent = bodies[idx(body.parent)];
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

TreeLink KinematicTree::link_in_body(int link) const {
  const Pose& T_body_link = T_body_link_[idx(link)];
  return {body_of_link_[idx(link)], T_body_link.R, T_body_link.p};
}

void KinematicTree::link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                               Scratch& scratch) const {
  if (q.size() < idx(description_.dof())) return;
  Scratch::Scope scope(scratch);
  const auto bodies = scope.array<Pose>(bodies_.size());
  place_bodies(q.data(), bodies);
  const std::size_t links = std::min(T_world_link.size(), body_of_link_.size());
  for (std::size_t i = 0; i < links; ++i) {
    const Pose& body = bodies[idx(body_of_link_[i])];
    T_world_link[i].setIdentity();
    T_world_link[i].linear().noalias() = body.R * T_body_link_[i].R;
    T_world_link[i].translation() = body.R * T_body_link_[i].p + body.p;
  }
}

void KinematicTree::sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                                        Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  if (count == 0) return;
  const std::size_t dof = idx(description_.dof());
  const std::size_t n = std::min(q.size() / dof, centres_m.size() / count * kLanes);
  Scratch::Scope scope(scratch);
  const auto bodies = scope.array<detail::Poses<double>>(bodies_.size());
  for (std::size_t row = 0; row < n; row += kLanes) {
    detail::place_bodies(bodies_, q.subspan(row * dof, std::min(kLanes, n - row) * dof), dof,
                         bodies.data());
    detail::carry_spheres(spheres_, bodies.data(), centres_m.data() + row / kLanes * count);
  }
}

void KinematicTree::sphere_centre_lanes(std::span<const double> q, std::span<PointFloats> centres_m,
                                        std::span<float> axes, Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  if (count == 0) return;
  const std::size_t dof = idx(description_.dof());
  const std::size_t n = std::min(q.size() / dof, centres_m.size() / count * kFloatLanes);
  auto* const all_axes = reinterpret_cast<detail::Axes<float>*>(axes.data());
  Scratch::Scope scope(scratch);
  const auto bodies = scope.array<detail::Poses<float>>(bodies_.size());
  for (std::size_t row = 0; row < n; row += kFloatLanes) {
    const std::size_t group = row / kFloatLanes;
    detail::place_bodies(bodies_, q.subspan(row * dof, std::min(kFloatLanes, n - row) * dof), dof,
                         bodies.data());
    detail::carry_spheres(spheres_, bodies.data(), centres_m.data() + group * count);
    detail::find_axes(bodies.data(), bodies_.size(), all_axes + group * bodies_.size());
  }
}

std::size_t KinematicTree::axes_size(std::size_t n) const noexcept {
  return float_groups(n) * bodies_.size() * (sizeof(detail::Axes<float>) / sizeof(float));
}

void KinematicTree::sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                                   Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  if (count == 0) return;
  const std::size_t n = std::min(q.size() / idx(description_.dof()), centres_m.size() / count);
  Scratch::Scope scope(scratch);
  const auto in_lanes = scope.array<PointLanes>(padded(n) / kLanes * count);
  sphere_centre_lanes(q.first(n * idx(description_.dof())), in_lanes, scratch);
  for (std::size_t row = 0; row < n; ++row) {
    const std::size_t lane = row % kLanes;
    for (std::size_t s = 0; s < count; ++s) {
      const PointLanes& centre = in_lanes[row / kLanes * count + s];
      centres_m[row * count + s] = {centre.x[lane], centre.y[lane], centre.z[lane]};
    }
  }
}

void KinematicTree::sphere_jacobians(std::span<const double> q,
                                     std::span<Eigen::Vector3d> centres_m,
                                     std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const {
  const std::size_t count = spheres_.size();
  const std::size_t dof = idx(description_.dof());
  if (count == 0) return;
  const std::size_t n =
      std::min({q.size() / dof, centres_m.size() / count, jacobians.size() / (count * dof)});
  Scratch::Scope scope(scratch);
  const auto bodies = scope.array<Pose>(bodies_.size());
  std::fill_n(jacobians.begin(), n * count * dof, Eigen::Vector3d::Zero());
  for (std::size_t row = 0; row < n; ++row) {
    place_bodies(q.data() + row * dof, bodies);
    for (std::size_t s = 0; s < count; ++s) {
      const std::size_t b = idx(spheres_[s].body);
      const Eigen::Vector3d centre = bodies[b].R * spheres_[s].p_body + bodies[b].p;
      centres_m[row * count + s] = centre;
      Eigen::Vector3d* columns = jacobians.data() + (row * count + s) * dof;
      for (int m = movers_begin_[b]; m < movers_begin_[b + 1]; ++m) {
        const std::size_t mover = idx(movers_[idx(m)]);
        const TreeBody& body = bodies_[mover];
        const Eigen::Vector3d axis = bodies[mover].R.col(2);
        // d(centre)/d(value): the axis, or axis x arm; a mimic joint adds to its master's column.
        columns[body.joint] += body.multiplier * (body.motion == TreeJoint::Motion::kRotation
                                                      ? axis.cross(centre - bodies[mover].p).eval()
                                                      : axis);
      }
    }
  }
}

void KinematicTree::pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                              std::span<double> joint_forces, Scratch& scratch) const {
  const std::size_t dof = idx(description_.dof());
  Scratch::Scope scope(scratch);
  const auto poses = scope.array<detail::Poses<double>>(bodies_.size());
  const auto axes = scope.array<detail::Axes<double>>(bodies_.size());
  const auto axes_of = [&](std::size_t group) {
    const auto from = q.subspan(group * kLanes * dof);
    detail::place_bodies(bodies_, from.first(std::min(from.size(), kLanes * dof)), dof,
                         poses.data());
    detail::find_axes(poses.data(), bodies_.size(), axes.data());
    return axes.data();
  };
  pull_back_with<double>(axes_of, forces, joint_forces, scratch);
}

void KinematicTree::pull_back_along(std::span<const float> axes, std::span<const LinkForce> forces,
                                    std::span<double> joint_forces, Scratch& scratch) const {
  const auto* const first = reinterpret_cast<const detail::Axes<float>*>(axes.data());
  const auto axes_of = [&](std::size_t group) { return first + group * bodies_.size(); };
  pull_back_with<float>(axes_of, forces, joint_forces, scratch);
}

/// axes_of(group): those of all bodies in the configurations of a group of lanes.
template <class Number, class AxesOf>
void KinematicTree::pull_back_with(const AxesOf& axes_of, std::span<const LinkForce> forces,
                                   std::span<double> joint_forces, Scratch& scratch) const {
  const std::size_t dof = idx(description_.dof());
  const std::size_t count = std::min(forces.size(), joint_forces.size() / dof);
  if (count == 0) return;
  constexpr std::size_t kInGroup = detail::kLanesOf<Number>;
  const std::size_t stride = padded(columns_.size());
  Scratch::Scope scope(scratch);
  const auto screws = scope.array<detail::Screws<Number>>(bodies_.size());
  const auto table = scope.array<Number>(6 * stride);
  // In one go of lanes those beyond the joints fall on the next row, which is written later.
  const bool in_rows = columns_.size() == dof && stride == kLanes;
  const bool in_place = in_rows && joint_forces.size() >= (count - 1) * dof + kLanes;
  const std::size_t step = in_rows ? dof : stride;
  const auto works = in_place ? joint_forces : scope.doubles(count * step + stride);
  std::ranges::fill(table, Number{});
  std::size_t group = 0;  // whose screws are known, counted from 1
  for (std::size_t k = 0, end = 0; k < count; k = end) {
    const std::size_t row = idx(forces[k].row), lane = row % kInGroup;
    if (row / kInGroup + 1 != group) {
      group = row / kInGroup + 1;
      detail::find_screws(bodies_, axes_of(group - 1), screws.data());
    }
    for (std::size_t c = 0; c < columns_.size(); ++c) {
      if (columns_[c].body == -1) continue;
      const detail::Screws<Number>& screw = screws[idx(columns_[c].body)];
      for (std::size_t i = 0; i < 6; ++i) table[i * stride + c] = screw.values[i][lane];
    }
    while (end < count && forces[end].row == forces[k].row) ++end;
    detail::find_works(forces.subspan(k, end - k), body_of_link_.data(), table.data(), stride,
                       weights_.data(), works.data() + k * step, step);
  }
  if (in_place) return;
  if (in_rows) {
    std::ranges::copy(works.first(count * dof), joint_forces.begin());
    return;
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double* work = works.data() + k * stride;
    double* out = joint_forces.data() + k * dof;
    for (std::size_t c = 0; c < dof; ++c) out[c] = work[c];
    for (std::size_t c = dof; c < columns_.size(); ++c) out[columns_[c].joint] += work[c];
  }
}

}  // namespace sidestep
