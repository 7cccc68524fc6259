#include <sidestep/runtime/standing_floor.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {
namespace {

constexpr double kParallel = 1e-4;  // of axes, as far as a URDF's digits go

/// How a link can move against the floor, as far as its height stays the same.
struct Level {
  bool holds = false;
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
  if (joint.joint < 0) {
    if (rotates) level.up_link = Eigen::AngleAxisd(-joint.offset, joint.axis) * level.up_link;
    return level;
  }
  if (rotates) {
    level.holds &= joint.axis.cross(level.up_link).norm() < kParallel;
    level.turns = true;
  } else {
    level.holds &= std::abs(joint.axis.dot(level.up_link)) < kParallel;
    level.slides.insert(joint.joint);
  }
  return level;
}

}  // namespace

std::optional<Floor> standing_floor(const RobotModel& robot) {
  const auto* tree = dynamic_cast<const KinematicTree*>(&robot);
  if (tree == nullptr) return std::nullopt;
  const RobotDescription& description = robot.description();
  std::vector<Level> levels;
  for (std::size_t i = 0; i < description.links.size(); ++i) {
    const int parent = description.links[i].parent;
    const Level from = parent < 0 ? Level{.holds = true} : levels[static_cast<std::size_t>(parent)];
    levels.push_back(child_of(from, tree->tree_joints()[i]));
  }
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
  if (planning.floor) return;
  if (auto floor = standing_floor(robot)) planning.floor.emplace().Floor::operator=(*floor);
}

}  // namespace sidestep
