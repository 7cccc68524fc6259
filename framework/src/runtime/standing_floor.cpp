#include <sidestep/runtime/standing_floor.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {
namespace {

constexpr double kParallel = 1e-4;  // of axes, as far as a URDF's digits go

/// How a link can move against the floor, as far as its height stays the same, or lifts along the
/// vertical change it.
struct Level {
  bool holds = false;
  bool is_upright = true;
  std::set<int> lifts;
  Eigen::Vector3d up_link = Eigen::Vector3d::UnitZ();  ///< The vertical, in the link's frame.
  std::set<int> slides;                                ///< Joints along the plane.
  bool turns = false;                                  ///< About the vertical.

  [[nodiscard]] bool drives() const { return holds && slides.size() >= 2 && turns; }
};

Level child_of(const Level& parent, const TreeJoint& joint) {
  Level level = parent;
  level.up_link = joint.T_parent_joint.linear().transpose() * parent.up_link;
  const bool rotates = joint.motion == TreeJoint::Motion::kRotation;
  if (joint.motion == TreeJoint::Motion::kFixed) return level;
  const bool is_vertical = joint.axis.cross(level.up_link).norm() < kParallel;
  if (joint.joint < 0) {  // held, as a base may be that a plan leaves where it is
    level.turns |= rotates && is_vertical;
    if (!rotates && std::abs(joint.axis.dot(level.up_link)) < kParallel) {
      level.slides.insert(-1 - static_cast<int>(level.slides.size()));
    }
    if (rotates) level.up_link = Eigen::AngleAxisd(-joint.offset, joint.axis) * level.up_link;
    return level;
  }
  if (rotates) {
    level.holds &= is_vertical;
    level.is_upright &= is_vertical;
    level.turns = true;
  } else {
    const bool is_level = std::abs(joint.axis.dot(level.up_link)) < kParallel;
    level.holds &= is_level;
    level.is_upright &= is_level || is_vertical;
    (is_vertical ? level.lifts : level.slides).insert(joint.joint);
  }
  return level;
}

std::vector<Level> levels_of(const KinematicTree& tree) {
  const std::vector<Link>& links = tree.description().links;
  std::vector<Level> levels;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const Level from = links[i].parent < 0 ? Level{.holds = true} : levels[idx(links[i].parent)];
    levels.push_back(child_of(from, tree.tree_joints()[i]));
  }
  return levels;
}

/// The least heights of the spheres' centres, as far as single lifts can bring them down.
std::vector<double> lowest_m(const KinematicTree& tree, const std::set<int>& lifts) {
  const RobotDescription& robot = tree.description();
  Scratch scratch;
  const auto heights = [&](const Eigen::VectorXd& q) {
    std::vector<Eigen::Vector3d> centres(robot.spheres.size());
    tree.sphere_centres(as_span(q), centres, scratch);
    std::vector<double> z(centres.size());
    std::ranges::transform(centres, z.begin(), [](const auto& centre) { return centre.z(); });
    return z;
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(robot.dof());
  const std::vector<double> at_zero = heights(zero);
  std::vector<double> lowest = at_zero;
  for (const int lift : lifts) {
    const Joint& joint = robot.joints[idx(lift)];
    Eigen::VectorXd q = zero;
    std::vector<double> drop(lowest.size(), kInfinity);
    for (const double limit : {joint.lower, joint.upper}) {
      q[lift] = limit;
      const std::vector<double> z = heights(q);
      for (std::size_t s = 0; s < drop.size(); ++s) drop[s] = std::min(drop[s], z[s] - at_zero[s]);
    }
    for (std::size_t s = 0; s < drop.size(); ++s) lowest[s] += drop[s];
  }
  return lowest;
}

/// Links that lifts along the vertical alone can lower, and none of whose spheres gets down to it.
std::vector<std::string> links_clear_of(const Floor& floor, const KinematicTree& tree) {
  const RobotDescription& robot = tree.description();
  const std::vector<Level> levels = levels_of(tree);
  std::vector<std::string> clear;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const bool has_limits = std::ranges::all_of(levels[i].lifts, [&](int lift) {
      const Joint& joint = robot.joints[idx(lift)];
      return std::isfinite(joint.lower) && std::isfinite(joint.upper);
    });
    if (levels[i].holds || !levels[i].is_upright || !has_limits) continue;
    const std::vector<double> lowest = lowest_m(tree, levels[i].lifts);
    bool is_clear = true;
    for (std::size_t s = 0; s < lowest.size(); ++s) {
      const CollisionSphere& sphere = robot.spheres[s];
      if (idx(sphere.link) != i) continue;
      is_clear &= lowest[s] - sphere.radius_m > floor.height_m;
    }
    if (is_clear) clear.push_back(robot.links[i].name);
  }
  return clear;
}

}  // namespace

std::optional<Floor> standing_floor(const RobotModel& robot) {
  const auto* tree = dynamic_cast<const KinematicTree*>(&robot);
  if (tree == nullptr) return std::nullopt;
  const RobotDescription& description = robot.description();
  const std::vector<Level> levels = levels_of(*tree);
  if (std::ranges::none_of(levels, &Level::drives)) return std::nullopt;
  const auto rises = [&](const auto& part) {
    return !levels[static_cast<std::size_t>(part.link)].holds;
  };
  if (std::ranges::none_of(description.spheres, rises) &&
      std::ranges::none_of(description.shapes, rises)) {
    return std::nullopt;
  }
  Floor floor;
  for (std::size_t i = 0; i < levels.size(); ++i) {
    if (levels[i].holds) floor.except_links.push_back(description.links[i].name);
  }
  return floor;
}

void stand_on_floor(PlanningSettings& planning, const RobotModel& robot) {
  if (!planning.floor) {
    if (auto floor = standing_floor(robot)) planning.floor.emplace().Floor::operator=(*floor);
  }
  const auto* tree = dynamic_cast<const KinematicTree*>(&robot);
  if (planning.floor && tree != nullptr) {
    planning.floor->clear_links = links_clear_of(*planning.floor, *tree);
  }
}

}  // namespace sidestep
