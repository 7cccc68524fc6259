#include <sidestep/robot/robot_model.hpp>

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/attached_object.hpp>
#include "configurations.hpp"

namespace sidestep {
namespace {

template <class Named>
std::optional<int> index_of(const std::vector<Named>& items, std::string_view name) noexcept {
  const auto it = std::ranges::find(items, name, &Named::name);
  if (it == items.end()) return {};
  return static_cast<int>(it - items.begin());
}

/// The first link of those that are rigidly attached to each other around `link`.
int rigid_root(const KinematicTree& tree, int link) {
  const auto moves = [&](int of) {
    const TreeJoint& joint = tree.tree_joints()[idx(of)];
    return joint.motion != TreeJoint::Motion::kFixed && joint.joint != -1;
  };
  while (!moves(link)) {
    const int parent = tree.description().links[idx(link)].parent;
    if (parent == -1) break;
    link = parent;
  }
  return link;
}

Result<int> find_link(const RobotDescription& robot, const std::string& link,
                      const AttachedObject& object) {
  if (const auto index = robot.link_index(link)) return *index;
  return fail(ErrorCode::kInvalidArgument, "robot '" + robot.name + "' has no link '" + link + "'",
              "object '" + object.name + "'");
}

/// Links with spheres or shapes that the object must not touch.
Result<std::vector<int>> links_to_avoid(const KinematicTree& tree, const AttachedObject& object,
                                        int holder) {
  const RobotDescription& robot = tree.description();
  std::vector<int> may_touch;
  for (const std::string& name : object.touch_links) {
    may_touch.push_back(SIDESTEP_TRY(find_link(robot, name, object)));
  }
  const int holding = rigid_root(tree, holder);
  std::vector<int> avoid;
  for (int link = 0; link < static_cast<int>(robot.links.size()); ++link) {
    const auto of_link = [link](const auto& part) { return part.link == link; };
    const bool solid =
        std::ranges::any_of(robot.spheres, of_link) || std::ranges::any_of(robot.shapes, of_link);
    const bool touches = std::ranges::find(may_touch, link) != may_touch.end();
    if (solid && !touches && rigid_root(tree, link) != holding) avoid.push_back(link);
  }
  return avoid;
}

}  // namespace

std::optional<int> RobotDescription::joint_index(std::string_view joint_name) const noexcept {
  return index_of(joints, joint_name);
}

std::optional<int> RobotDescription::link_index(std::string_view link_name) const noexcept {
  return index_of(links, link_name);
}

const NamedPose* RobotDescription::find_pose(std::string_view pose_name) const noexcept {
  const auto it = std::ranges::find(poses, pose_name, &NamedPose::name);
  return it == poses.end() ? nullptr : &*it;
}

std::optional<std::array<int, 2>> RobotDescription::planar_base() const noexcept {
  std::array<int, 2> base{};
  int found = 0;
  for (int j = 0; j < dof() && found < 2; ++j) {
    if (joints[idx(j)].type == Joint::Type::kPrismatic) base[idx(found++)] = j;
  }
  return found == 2 ? std::optional(base) : std::nullopt;
}

void RobotModel::sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                                     Scratch& scratch) const {
  const std::size_t count = description().spheres.size();
  if (count == 0) return;
  const std::size_t n = q.size() / description().joints.size();
  Scratch::Scope scope(scratch);
  const auto in_rows_m = scope.array<Eigen::Vector3d>(n * count);
  sphere_centres(q, in_rows_m, scratch);
  for (std::size_t row = 0; row < padded(n); ++row) {
    for (std::size_t s = 0; s < count; ++s) {
      const Eigen::Vector3d& centre_m = in_rows_m[std::min(row, n - 1) * count + s];
      PointLanes& out = centres_m[row / kLanes * count + s];
      out.x[row % kLanes] = centre_m.x();
      out.y[row % kLanes] = centre_m.y();
      out.z[row % kLanes] = centre_m.z();
    }
  }
}

Result<std::unique_ptr<KinematicTree>> attach_object(const RobotModel& robot,
                                                     const AttachedObject& object) {
  const auto* tree = dynamic_cast<const KinematicTree*>(&robot);
  if (tree == nullptr) {
    return fail(ErrorCode::kInvalidArgument,
                "objects can be attached to kinematic trees only, and robot '" +
                    robot.description().name + "' is another kind of model",
                "object '" + object.name + "'");
  }
  RobotDescription description = tree->description();
  const auto holder = SIDESTEP_TRY(find_link(description, object.link, object));
  const auto avoid = SIDESTEP_TRY(links_to_avoid(*tree, object, holder));

  const int link = static_cast<int>(description.links.size());
  description.links.push_back({object.name, holder});
  for (const auto& sphere : object.spheres) {
    description.spheres.push_back({link, sphere.centre_m, sphere.radius_m});
  }
  for (const auto& shape : object.shapes) {
    description.shapes.push_back({link, shape.shape, shape.T_object_shape});
  }
  const bool has_extent = !object.spheres.empty() || !object.shapes.empty();
  for (const int other : has_extent ? avoid : std::vector<int>{}) {
    description.self_collision_pairs.emplace_back(other, link);
  }

  std::vector<TreeJoint> joints = tree->tree_joints();
  joints.emplace_back();
  joints.back().name = object.name;
  joints.back().T_parent_joint = object.T_link_object;
  return KinematicTree::create(std::move(description), std::move(joints));
}

std::vector<bool> fixed_spheres(const RobotModel& robot) {
  const RobotDescription& description = robot.description();
  std::vector<bool> fixed(description.spheres.size(), true);
  std::vector<Eigen::Vector3d> first_m(fixed.size()), centres_m(fixed.size());
  Scratch scratch;
  for (const double share : {0.5, 0.13, 0.79}) {
    robot.sphere_centres(configuration_at(description, share), centres_m, scratch);
    if (share == 0.5) first_m = centres_m;
    for (std::size_t s = 0; s < fixed.size(); ++s) {
      fixed[s] = fixed[s] && (centres_m[s] - first_m[s]).norm() < 1e-9;
    }
  }
  return fixed;
}

}  // namespace sidestep
