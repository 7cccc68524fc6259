#include "goal_wishes.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "figures.hpp"
#include "reach_seed.hpp"

namespace sidestep::ros1_executor {
namespace {

/// A base's pose may be tilted by so much, which a hand-held or rounded orientation is.
constexpr double kLevel_rad = 0.1;

tl::unexpected<Error> refuse(const std::string& topic, std::string why, std::string hint = {}) {
  return fail(ErrorCode::kInvalidArgument, std::move(why), topic, std::move(hint));
}

/// Builds maps with one origin.
class WishWriter {
 public:
  explicit WishWriter(std::string topic) : mark_{std::move(topic), 0, 0} {}

  [[nodiscard]] Node number(double value) const {
    return {Node::Scalar{detail::number_text(value), false}, mark_};
  }
  [[nodiscard]] Node text(const std::string& value) const {
    return {Node::Scalar{value, true}, mark_};
  }
  [[nodiscard]] Node list(const Eigen::Vector3d& values) const {
    Node::List items;
    for (const double value : values) items.push_back(number(value));
    return {std::move(items), mark_};
  }
  [[nodiscard]] Node map(std::vector<std::pair<std::string, Node>> entries) const {
    Node::Map made;
    for (auto& [key, value] : entries) made.push_back({key, mark_, std::move(value)});
    return {std::move(made), mark_};
  }

 private:
  SourceMark mark_;
};

/// As transform_from_xyz_rpy() takes them: R = Rz(yaw) Ry(pitch) Rx(roll).
Eigen::Vector3d rpy_of(const Eigen::Matrix3d& R) {
  const double pitch = std::atan2(-R(2, 0), std::hypot(R(2, 1), R(2, 2)));
  constexpr double kUpright = 1e-9;
  if (std::hypot(R(2, 1), R(2, 2)) < kUpright) {
    // Roll and yaw are about one axis: all of it is yaw.
    return {0.0, pitch, std::atan2(-R(0, 1), R(1, 1))};
  }
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

}  // namespace

Result<GoalWishes> GoalWishes::create(std::shared_ptr<const RobotModel> robot,
                                      const Options& options) {
  const RobotDescription& description = robot->description();
  GoalWishes wishes;
  wishes.topics_ = *options.goals;
  wishes.odometry_ = options.odometry;
  wishes.keep_in_ = options.keep_in;
  if (!wishes.topics_.end_effector_topic.empty()) {
    const std::string& link = wishes.topics_.end_effector_link;
    const auto index = description.link_index(link);
    if (!index) {
      return fail(ErrorCode::kConfig, "robot '" + description.name + "' has no link '" + link + "'",
                  "executor.goals.end_effector_link");
    }
    wishes.link_ = *index;
  }
  if (wishes.odometry_) {
    wishes.yaw_ = description.joint_index(wishes.odometry_->yaw_joint).value();
  }
  wishes.robot_ = std::move(robot);
  return wishes;
}

Result<void> GoalWishes::check_box(const std::string& topic, const Positions& positions) const {
  if (!keep_in_) return {};
  const std::string* const names[] = {&odometry_->x_joint, &odometry_->y_joint};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto wanted = positions.find(*names[axis]);
    const double lower = keep_in_->lower_m[axis];
    const double upper = keep_in_->upper_m[axis];
    if (wanted == positions.end()) continue;
    if (wanted->second >= lower && wanted->second <= upper) continue;
    return refuse(topic,
                  "the base is to be out of keep_in: " + *names[axis] + " at " +
                      figure(wanted->second) + " m, the box is " + figure(lower) + " to " +
                      figure(upper) + " m",
                  "another goal, or a larger box");
  }
  return {};
}

Node GoalWishes::goal_block(const std::string& topic, const Positions& positions) {
  const WishWriter write(topic);
  std::vector<std::pair<std::string, Node>> joints;
  for (const auto& [name, position] : positions) joints.emplace_back(name, write.number(position));
  return write.map({{"joints", write.map(std::move(joints))}});
}

Node GoalWishes::state_wish(const std::string& topic, const Positions& positions) {
  return WishWriter(topic).map({{"goal", goal_block(topic, positions)}});
}

Result<Node> GoalWishes::base_pose(const Transform& T_world_goal,
                                   const Eigen::VectorXd& q_now) const {
  const std::string& topic = topics_.base_pose_topic;
  if (!odometry_) return refuse(topic, "the robot has no base: the executor has no odometry");
  const Eigen::Matrix3d R = T_world_goal.linear();
  const double tilt_rad = std::acos(std::clamp(R(2, 2), -1.0, 1.0));
  if (tilt_rad > kLevel_rad) {
    return refuse(topic, "the pose is not level: it is tilted by " + figure(tilt_rad) + " rad");
  }
  const double yaw = std::atan2(R(1, 0), R(0, 0));
  const double yaw_now = q_now[yaw_];
  const Positions positions{
      {odometry_->x_joint, T_world_goal.translation().x()},
      {odometry_->y_joint, T_world_goal.translation().y()},
      {odometry_->yaw_joint, yaw_now + std::remainder(yaw - yaw_now, 2.0 * std::numbers::pi)}};
  SIDESTEP_TRY(check_box(topic, positions));
  return state_wish(topic, positions);
}

Result<Node> GoalWishes::end_effector(const Transform& T_world_goal,
                                      const Eigen::VectorXd& q_now) const {
  const std::string& topic = topics_.end_effector_topic;
  const WishWriter write(topic);
  std::vector<std::pair<std::string, Node>> target{
      {"link", write.text(topics_.end_effector_link)},
      {"position_m", write.list(T_world_goal.translation())}};
  if (topics_.end_effector_turns) {
    target.emplace_back("rpy_rad", write.list(rpy_of(T_world_goal.linear())));
  }
  const Eigen::VectorXd seed = reach_seed(
      *robot_, {link_, T_world_goal, topics_.end_effector_turns}, odometry_, keep_in_, q_now);
  const auto& joints = robot_->description().joints;
  Positions positions;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    positions[joints[j].name] = seed[static_cast<Eigen::Index>(j)];
  }
  return write.map(
      {{"goal", goal_block(topic, positions)}, {"end_effector", write.map(std::move(target))}});
}

Result<Node> GoalWishes::joints(const ros_messages::JointState& message) const {
  const std::string& topic = topics_.joints_topic;
  if (message.name.empty()) return refuse(topic, "it names no joint");
  if (message.name.size() != message.position.size()) {
    return refuse(topic, "it names " + std::to_string(message.name.size()) + " joints, and has " +
                             std::to_string(message.position.size()) + " positions");
  }
  Positions positions;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    if (!std::isfinite(message.position[i])) {
      return refuse(topic, "the position of joint '" + message.name[i] + "' is not finite");
    }
    if (!positions.emplace(message.name[i], message.position[i]).second) {
      return refuse(topic, "it names joint '" + message.name[i] + "' twice");
    }
  }
  SIDESTEP_TRY(check_box(topic, positions));
  return state_wish(topic, positions);
}

Result<Node> GoalWishes::named_pose(const std::string& name) const {
  const std::string& topic = topics_.pose_topic;
  const RobotDescription& robot = robot_->description();
  Positions positions;
  if (const NamedPose* const pose = robot.find_pose(name)) {
    for (std::size_t j = 0; j < pose->positions.size(); ++j) {
      if (pose->positions[j]) positions[robot.joints[j].name] = *pose->positions[j];
    }
  }
  SIDESTEP_TRY(check_box(topic, positions));
  const WishWriter write(topic);
  return write.map({{"goal", write.map({{"pose", write.text(name)}})}});
}

}  // namespace sidestep::ros1_executor
