#include <algorithm>
#include <set>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

#include "build_robot.hpp"
#include "inputs.hpp"
#include "load_robot.hpp"
#include "srdf_file.hpp"

namespace sidestep {
namespace {

using LinkPairs = std::set<std::pair<int, int>>;

Node said(const std::string& text) {
  return Node(Node::Scalar{text, true}, SourceMark{"command line"});
}

/// How many joints move two links against each other.
int joints_between(const KinematicTree& robot, int a, int b) {
  int count = 0;
  while (a != b) {  // parents come before their children
    int& later = a > b ? a : b;
    if (robot.tree_joints()[idx(later)].joint >= 0) ++count;
    later = robot.description().links[idx(later)].parent;
  }
  return count;
}

/// All pairs of links with shapes that so many joints or more move against each other, but these.
std::vector<std::pair<int, int>> pairs_but(const KinematicTree& robot, const LinkPairs& left_out,
                                           int least_joints) {
  std::set<int> links;
  for (const CollisionShape& shape : robot.description().shapes) links.insert(shape.link);
  std::vector<std::pair<int, int>> pairs;
  for (const int a : links) {
    for (const int b : links) {
      if (a >= b || left_out.contains({a, b})) continue;
      if (joints_between(robot, a, b) >= least_joints) pairs.emplace_back(a, b);
    }
  }
  return pairs;
}

/// The pairs that an SRDF disables. Of a profile, which may have a part of the URDF alone, links
/// may be missing.
Result<LinkPairs> disabled_pairs(const std::filesystem::path& file, const RobotDescription& robot,
                                 bool is_whole) {
  LinkPairs pairs;
  for (const urdf_robot::Srdf::DisabledPair& one :
       SIDESTEP_TRY(urdf_robot::read_srdf(file)).disabled) {
    const auto a = robot.link_index(one.a), b = robot.link_index(one.b);
    if (a && b) pairs.insert(std::minmax(*a, *b));
    if (is_whole && !(a && b)) {
      return fail(ErrorCode::kConfig, "the robot has no link '" + (a ? one.b : one.a) + "'",
                  one.mark.to_string());
    }
  }
  if (!pairs.empty()) return pairs;
  return fail(ErrorCode::kConfig, "disables no two links of robot '" + robot.name + "'",
              file.string());
}

Result<std::shared_ptr<const KinematicTree>> with_pairs(const KinematicTree& robot,
                                                        std::vector<std::pair<int, int>> pairs) {
  RobotDescription description = robot.description();
  description.self_collision_pairs = std::move(pairs);
  return std::shared_ptr<const KinematicTree>(
      SIDESTEP_TRY(KinematicTree::create(std::move(description), robot.tree_joints())));
}

/// A robot that no longer plans for a joint, which stays where it is.
Result<std::shared_ptr<const KinematicTree>> with_held(const KinematicTree& robot, int held,
                                                       double value) {
  RobotDescription description = robot.description();
  const Joint& joint = description.joints[idx(held)];
  if (joint.type != Joint::Type::kContinuous && !(value >= joint.lower && value <= joint.upper)) {
    return fail(ErrorCode::kConfig, joint.name + " would stay outside of its limits", "--fixed");
  }
  description.joints.erase(description.joints.begin() + held);
  description.poses.clear();
  std::vector<TreeJoint> joints = robot.tree_joints();
  for (TreeJoint& of_link : joints) {
    if (of_link.joint == held) {
      of_link.joint = -1;
      of_link.offset += of_link.multiplier * value;
    } else if (of_link.joint > held) {
      --of_link.joint;
    }
  }
  return std::shared_ptr<const KinematicTree>(
      SIDESTEP_TRY(KinematicTree::create(std::move(description), std::move(joints))));
}

}  // namespace

Result<std::shared_ptr<const KinematicTree>> read_certified_robot(const RobotInput& input,
                                                                  const HostContext& context) {
  const bool is_urdf = std::filesystem::path(input.robot).extension() == ".urdf";
  urdf_robot::Options options;
  if (is_urdf) {
    options.urdf = input.robot;
  } else {
    options.profile = said(input.robot);
  }
  Node::Map fixed;
  for (const std::string& text : input.fixed) {
    const auto equals = text.find('=');
    if (equals == std::string::npos) {
      return fail(ErrorCode::kConfig, "'" + text + "' is not JOINT=VALUE", "--fixed");
    }
    const SourceMark mark{"--fixed " + text};
    fixed.push_back(
        {text.substr(0, equals), mark, Node(Node::Scalar{text.substr(equals + 1), false}, mark)});
  }
  Node::List packages;
  for (const auto& [name, folder] : urdf_robot::package_paths_of(input.package_paths)) {
    const Node path = said(folder.string());
    packages.push_back(name.empty() ? path
                                    : Node(Node::Map{{name, path.mark(), path}}, path.mark()));
  }
  if (!packages.empty()) {
    options.package_paths = Node(std::move(packages), SourceMark{"command line"});
  }
  std::shared_ptr<const KinematicTree> robot;
  // What a profile plans for is held afterwards, as the rest of it speaks of these joints.
  Node::Map held;
  if (!is_urdf) {
    robot = SIDESTEP_TRY(urdf_robot::load_robot(options, context));
    const auto others = std::stable_partition(fixed.begin(), fixed.end(), [&](const auto& entry) {
      return robot->description().joint_index(entry.key).has_value();
    });
    held.assign(fixed.begin(), others);
    fixed.erase(fixed.begin(), others);
  }
  if (robot == nullptr || !fixed.empty()) {
    if (!fixed.empty()) options.fixed_joints = Node(std::move(fixed), SourceMark{"command line"});
    robot = SIDESTEP_TRY(urdf_robot::load_robot(options, context));
  }
  for (const auto& entry : held) {
    const auto joint = robot->description().joint_index(entry.key);
    if (!joint) return tl::make_unexpected(entry.value.error("stands twice"));
    robot = SIDESTEP_TRY(with_held(*robot, *joint, SIDESTEP_TRY(entry.value.as_double())));
  }
  if (!input.srdf && !is_urdf) return robot;
  if (!input.srdf) return with_pairs(*robot, pairs_but(*robot, {}, 2));
  const auto disabled = SIDESTEP_TRY(disabled_pairs(*input.srdf, robot->description(), is_urdf));
  return with_pairs(*robot, pairs_but(*robot, disabled, 0));
}

Result<std::shared_ptr<const KinematicTree>> carrying(const KinematicTree& robot,
                                                      std::span<const CarriedObject> objects,
                                                      const std::string& where) {
  RobotDescription description = robot.description();
  std::vector<TreeJoint> joints = robot.tree_joints();
  const std::size_t links = description.links.size();
  for (const CarriedObject& object : objects) {
    std::set<int> may_touch;
    const auto find = [&](const std::string& name) -> Result<int> {
      if (const auto link = robot.description().link_index(name)) return *link;
      return fail(ErrorCode::kConfig,
                  "'" + object.name + "' is attached to, or may touch, '" + name +
                      "', which is no link of robot '" + description.name + "'",
                  where);
    };
    const int parent = SIDESTEP_TRY(find(object.link));
    may_touch.insert(parent);
    for (const std::string& link : object.touch_links) {
      may_touch.insert(SIDESTEP_TRY(find(link)));
    }
    const int number = static_cast<int>(description.links.size());
    if (description.link_index(object.name)) {
      return fail(ErrorCode::kConfig,
                  "an object is attached that is called '" + object.name + "', as a link is",
                  where);
    }
    description.links.push_back({object.name, parent});
    joints.push_back({object.name});
    for (CollisionShape shape : object.shapes) {
      shape.link = number;
      description.shapes.push_back(std::move(shape));
    }
    std::set<int> others;
    for (const CollisionShape& shape : description.shapes) others.insert(shape.link);
    for (const int other : others) {
      if (other == number || may_touch.contains(other)) continue;
      // What the same link carries is not held against each other, as in MoveIt.
      if (idx(other) >= links && description.links[idx(other)].parent == parent) continue;
      description.self_collision_pairs.emplace_back(other, number);
    }
  }
  return std::shared_ptr<const KinematicTree>(
      SIDESTEP_TRY(KinematicTree::create(std::move(description), std::move(joints))));
}

}  // namespace sidestep
