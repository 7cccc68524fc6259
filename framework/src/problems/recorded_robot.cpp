#include "recorded_robot.hpp"

#include <limits>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {
namespace {

/// The recorded problems know no limits.
constexpr double kNoLimit = 1e6;

/// A chain of links, put together from the world outwards.
class Chain {
 public:
  explicit Chain(std::string name) : tree_(1) {
    description_.name = std::move(name);
    description_.links.push_back({"world", -1});
  }

  [[nodiscard]] int joints() const { return description_.dof(); }

  void slide(const std::string& name, const Eigen::Vector3d& axis,
             const Transform& T_parent_joint) {
    add(name, TreeJoint::Motion::kTranslation, axis, T_parent_joint, 0.0);
    description_.joints.push_back(
        {name, Joint::Type::kPrismatic, -kNoLimit, kNoLimit, kNoLimit, kInfinity});
  }
  void turn(const std::string& name, const Transform& T_parent_joint, double bias) {
    add(name, TreeJoint::Motion::kRotation, Eigen::Vector3d::UnitZ(), T_parent_joint, bias);
    description_.joints.push_back(
        {name, Joint::Type::kContinuous, -kInfinity, kInfinity, kNoLimit, kInfinity});
  }
  /// A sphere on the link that the joint with this index moves.
  void add_sphere(int joint, const Eigen::Vector3d& centre_m, double radius_m) {
    description_.spheres.push_back({joint + 1, centre_m, radius_m});
  }
  [[nodiscard]] Result<std::shared_ptr<const RobotModel>> finish() {
    auto made = SIDESTEP_TRY(KinematicTree::create(std::move(description_), std::move(tree_)));
    return std::shared_ptr<const RobotModel>(std::move(made));
  }

 private:
  void add(const std::string& name, TreeJoint::Motion motion, const Eigen::Vector3d& axis,
           const Transform& T_parent_joint, double bias) {
    TreeJoint joint;
    joint.name = name;
    joint.motion = motion;
    joint.T_parent_joint = T_parent_joint;
    joint.axis = axis;
    joint.joint = joints();
    joint.offset = bias;
    tree_.push_back(joint);
    description_.links.push_back({name, joints()});
  }

  RobotDescription description_;
  std::vector<TreeJoint> tree_;
};

/// The joints of an arm. `after` are the transforms from each joint, past its motion, to its frame:
/// in the classical convention the twist comes after the joint.
void add_arm(const JsonEntry& robot, std::size_t count, const Transform& T_parent_arm, Chain& chain,
             std::vector<Transform>& after) {
  const std::string convention = robot["dh"].text();
  const bool modified = convention.starts_with("modified");
  if (!modified && !convention.starts_with("classical")) {
    robot["dh"].complain("the convention must begin with \"modified\" or \"classical\"");
  }
  const Eigen::VectorXd a = robot["a"].numbers(count), d = robot["d"].numbers(count);
  const Eigen::VectorXd alpha = robot["alpha"].numbers(count);
  Eigen::VectorXd bias = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(count));
  if (robot.has("theta_bias")) bias = robot["theta_bias"].numbers(count);
  Transform T_parent = T_parent_arm;
  for (Eigen::Index i = 0; i < bias.size(); ++i) {
    Transform twist = Transform::Identity();
    twist.rotate(Eigen::AngleAxisd(alpha[i], Eigen::Vector3d::UnitX()));
    const std::string name = "joint_" + std::to_string(chain.joints() + 1);
    const Eigen::Vector3d along(a[i], 0.0, 0.0), up(0.0, 0.0, d[i]);
    if (modified) {
      chain.turn(name, T_parent * twist * Eigen::Translation3d(along + up), bias[i]);
      T_parent = Transform::Identity();
      after.push_back(Transform::Identity());
    } else {
      chain.turn(name, T_parent, bias[i]);
      T_parent = Eigen::Translation3d(up + along) * twist;
      after.push_back(T_parent);
    }
  }
}

Transform translation(const Eigen::Vector3d& by) { return Transform(Eigen::Translation3d(by)); }

/// x, y, heading and lift, below an arm.
void add_base(const JsonEntry& robot, Chain& chain) {
  chain.slide("base_x", Eigen::Vector3d::UnitX(), Transform::Identity());
  chain.slide("base_y", Eigen::Vector3d::UnitY(), Transform::Identity());
  chain.turn("base_heading", Transform::Identity(), 0.0);
  chain.slide("lift", Eigen::Vector3d::UnitZ(), translation(robot["base_T_torso"].vector3()));
}

}  // namespace

Result<RecordedRobot> read_recorded_robot(const JsonEntry& robot, int dof) {
  constexpr int kHeading = 2, kBaseJoints = 4;
  RecordedRobot read;
  read.has_base = robot.has("base_T_torso");
  Chain chain(robot["name"].text());
  std::vector<Transform> after;
  int first_link = 0;  // the joint that moves the recording's link 0
  if (!robot.has("dh")) {
    if (dof > 3)
      robot.complain("a point moves along 3 axes at most, but the configurations have " +
                     std::to_string(dof) + " numbers");
    for (int axis = 0; axis < std::min(dof, 3); ++axis) {
      chain.slide(std::string(1, "xyz"[axis]), Eigen::Vector3d::Unit(axis), Transform::Identity());
    }
    first_link = chain.joints() - 1;
  } else if (read.has_base) {
    if (dof <= kBaseJoints)
      robot.complain("configurations of a mobile arm have more numbers than 4");
    add_base(robot, chain);
    add_arm(robot, static_cast<std::size_t>(std::max(0, dof - kBaseJoints)),
            translation(robot["torso_T_arm"].vector3()), chain, after);
    after.insert(after.begin(), kBaseJoints, Transform::Identity());
    first_link = kHeading;
  } else {
    add_arm(robot, static_cast<std::size_t>(dof), Transform::Identity(), chain, after);
  }
  after.resize(static_cast<std::size_t>(chain.joints()), Transform::Identity());
  for (const JsonEntry& sphere : robot["spheres"].items()) {
    const Eigen::VectorXd numbers = sphere.numbers(5);
    const int joint = first_link + sphere.at(0).integer(0, chain.joints() - 1 - first_link);
    const Eigen::Vector3d centre_m = numbers.segment<3>(1);
    chain.add_sphere(joint, after[idx(joint)] * centre_m, sphere.at(4).positive());
  }
  auto model = SIDESTEP_TRY(chain.finish());
  read.model = std::move(model);
  return read;
}

}  // namespace sidestep
