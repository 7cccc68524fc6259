#include "goals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <boost/function.hpp>

#include "motion_checks.hpp"
#include "node.hpp"

namespace sidestep::ros1_executor {
namespace {

/// What is as bad as a metre off: a link that is turned wrong by three radians, a base that goes
/// twenty metres, or turns by thirty radians.
constexpr double kTurned_m_per_rad = 0.3;
constexpr double kTravelled = 0.05;
constexpr double kTurning_m_per_rad = 0.03;
constexpr double kOutside_m = 100.0;
/// For a link whose rotation does not count.
constexpr int kHeadings = 16;

struct BaseIndices {
  int x, y, yaw;
};

/// The turn about z that brings `R` nearest to `R_target`: it maximises the trace of
/// R_target^T Rz(yaw) R.
double best_turn(const Eigen::Matrix3d& R, const Eigen::Matrix3d& R_target) {
  const Eigen::Matrix3d M = R * R_target.transpose();
  return std::atan2(M(0, 1) - M(1, 0), M(0, 0) + M(1, 1));
}

class SeedSearch {
 public:
  SeedSearch(const RobotModel& robot, const Reach& reach, const std::optional<KeepInBox>& keep_in,
             std::optional<BaseIndices> base, const Eigen::VectorXd& q_now)
      : robot_(robot),
        reach_(reach),
        keep_in_(keep_in),
        base_(base),
        q_now_(q_now),
        best_(q_now),
        T_world_link_(robot.description().links.size()) {}

  /// With the base wherever it suits the posture.
  void consider(Eigen::VectorXd q) {
    if (!base_) return weigh(std::move(q));
    q[base_->yaw] = q_now_[base_->yaw];
    if (reach_.turns) {
      return place(q, best_turn(link_at(q).linear(), reach_.T_world_target.linear()));
    }
    for (int i = 0; i < kHeadings; ++i) place(q, 2.0 * std::numbers::pi * i / kHeadings);
  }
  [[nodiscard]] const Eigen::VectorXd& best() const noexcept { return best_; }

 private:
  [[nodiscard]] const Transform& link_at(const Eigen::VectorXd& q) {
    robot_.link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link_, scratch_);
    return T_world_link_[static_cast<std::size_t>(reach_.link)];
  }

  /// Turned on by an angle, and moved until the link is above or below its target.
  void place(Eigen::VectorXd q, double turn_rad) {
    q[base_->yaw] += std::remainder(turn_rad, 2.0 * std::numbers::pi);
    const Eigen::Vector3d off_m =
        reach_.T_world_target.translation() - Eigen::Vector3d(link_at(q).translation());
    q[base_->x] += off_m.x();
    q[base_->y] += off_m.y();
    weigh(std::move(q));
  }

  void weigh(Eigen::VectorXd q) {
    // What is measured may be a little beyond a limit.
    const auto& joints = robot_.description().joints;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      double& position = q[static_cast<Eigen::Index>(j)];
      position = std::clamp(position, joints[j].lower, joints[j].upper);
    }
    const Transform off = reach_.T_world_target.inverse() * link_at(q);
    double cost_m = off.translation().norm();
    if (reach_.turns) cost_m += kTurned_m_per_rad * Eigen::AngleAxisd(off.linear()).angle();
    if (base_) cost_m += cost_of_base(q);
    if (cost_m >= least_m_) return;
    least_m_ = cost_m;
    best_ = std::move(q);
  }

  [[nodiscard]] double cost_of_base(const Eigen::VectorXd& q) const {
    const double travel_m =
        std::hypot(q[base_->x] - q_now_[base_->x], q[base_->y] - q_now_[base_->y]);
    const double turn_rad = std::abs(q[base_->yaw] - q_now_[base_->yaw]);
    const auto is_inside = [&](int joint, std::size_t axis) {
      return q[joint] >= keep_in_->lower_m[axis] && q[joint] <= keep_in_->upper_m[axis];
    };
    const bool stays = !keep_in_ || (is_inside(base_->x, 0) && is_inside(base_->y, 1));
    return kTravelled * travel_m + kTurning_m_per_rad * turn_rad + (stays ? 0.0 : kOutside_m);
  }

  const RobotModel& robot_;
  const Reach& reach_;
  const std::optional<KeepInBox>& keep_in_;
  std::optional<BaseIndices> base_;
  const Eigen::VectorXd& q_now_;
  Eigen::VectorXd best_;
  double least_m_ = std::numeric_limits<double>::infinity();
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

/// A base's pose may be tilted by so much, which a hand-held or rounded orientation is.
constexpr double kLevel_rad = 0.1;

tl::unexpected<Error> refuse_goal(const std::string& topic, std::string why,
                                  std::string hint = {}) {
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

using ros1_node::ros_now;
using State = GoalReport::State;
using ros_messages::GoalStatus;
using ros_messages::LookupFault;

constexpr std::uint32_t kGoalQueue = 10;
constexpr std::uint32_t kTfQueue = 1000;
/// Of tf.
constexpr double kTransformsKept_s = 10.0;

std::uint8_t status_of(State state) {
  switch (state) {
    case State::kAccepted:
    case State::kActive: return GoalStatus::ACTIVE;
    case State::kRefused: return GoalStatus::REJECTED;
    case State::kReached: return GoalStatus::SUCCEEDED;
    case State::kFailed: return GoalStatus::ABORTED;
    case State::kReplaced: return GoalStatus::PREEMPTED;
  }
  return GoalStatus::LOST;
}

bool is_final(State state) { return state != State::kAccepted && state != State::kActive; }

std::string text_of(const GoalReport& report) {
  std::string text(to_string(report.state));
  if (report.state == State::kActive) {
    return text + ": " + figure(report.farthest_joint) + " m or rad to go";
  }
  return report.message.empty() ? text : text + ": " + report.message;
}

}  // namespace

Eigen::VectorXd reach_seed(const RobotModel& robot, const Reach& reach,
                           const std::optional<OdometryOptions>& base,
                           const std::optional<KeepInBox>& keep_in, const Eigen::VectorXd& q_now) {
  const RobotDescription& description = robot.description();
  std::optional<BaseIndices> indices;
  if (base) {
    indices = {description.joint_index(base->x_joint).value(),
               description.joint_index(base->y_joint).value(),
               description.joint_index(base->yaw_joint).value()};
  }
  SeedSearch search(robot, reach, keep_in, indices, q_now);
  search.consider(q_now);
  for (const NamedPose& pose : description.poses) {
    Eigen::VectorXd q = q_now;
    for (std::size_t j = 0; j < pose.positions.size(); ++j) {
      if (pose.positions[j]) q[static_cast<Eigen::Index>(j)] = *pose.positions[j];
    }
    search.consider(std::move(q));
  }
  return search.best();
}

Result<GoalMessageParser> GoalMessageParser::create(std::shared_ptr<const RobotModel> robot,
                                                    const Options& options) {
  const RobotDescription& description = robot->description();
  GoalMessageParser wishes;
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

Result<void> GoalMessageParser::check_box(const std::string& topic,
                                          const Positions& positions) const {
  if (!keep_in_) return {};
  const std::string* const names[] = {&odometry_->x_joint, &odometry_->y_joint};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const auto wanted = positions.find(*names[axis]);
    const double lower = keep_in_->lower_m[axis];
    const double upper = keep_in_->upper_m[axis];
    if (wanted == positions.end()) continue;
    if (wanted->second >= lower && wanted->second <= upper) continue;
    return refuse_goal(topic,
                       "the base is to be out of keep_in: " + *names[axis] + " at " +
                           figure(wanted->second) + " m, the box is " + figure(lower) + " to " +
                           figure(upper) + " m",
                       "another goal, or a larger box");
  }
  return {};
}

Node GoalMessageParser::goal_block(const std::string& topic, const Positions& positions) {
  const WishWriter write(topic);
  std::vector<std::pair<std::string, Node>> joints;
  for (const auto& [name, position] : positions) joints.emplace_back(name, write.number(position));
  return write.map({{"joints", write.map(std::move(joints))}});
}

Node GoalMessageParser::state_wish(const std::string& topic, const Positions& positions) {
  return WishWriter(topic).map({{"goal", goal_block(topic, positions)}});
}

Result<Node> GoalMessageParser::base_pose(const Transform& T_world_goal,
                                          const Eigen::VectorXd& q_now) const {
  const std::string& topic = topics_.base_pose_topic;
  if (!odometry_) return refuse_goal(topic, "the robot has no base: the executor has no odometry");
  const Eigen::Matrix3d R = T_world_goal.linear();
  const double tilt_rad = std::acos(std::clamp(R(2, 2), -1.0, 1.0));
  if (tilt_rad > kLevel_rad) {
    return refuse_goal(topic,
                       "the pose is not level: it is tilted by " + figure(tilt_rad) + " rad");
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

Result<Node> GoalMessageParser::end_effector(const Transform& T_world_goal,
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

Result<Node> GoalMessageParser::joints(const ros_messages::JointState& message) const {
  const std::string& topic = topics_.joints_topic;
  if (message.name.empty()) return refuse_goal(topic, "it names no joint");
  if (message.name.size() != message.position.size()) {
    return refuse_goal(topic, "it names " + std::to_string(message.name.size()) +
                                  " joints, and has " + std::to_string(message.position.size()) +
                                  " positions");
  }
  Positions positions;
  for (std::size_t i = 0; i < message.name.size(); ++i) {
    if (!std::isfinite(message.position[i])) {
      return refuse_goal(topic, "the position of joint '" + message.name[i] + "' is not finite");
    }
    if (!positions.emplace(message.name[i], message.position[i]).second) {
      return refuse_goal(topic, "it names joint '" + message.name[i] + "' twice");
    }
  }
  SIDESTEP_TRY(check_box(topic, positions));
  return state_wish(topic, positions);
}

Result<Node> GoalMessageParser::named_pose(const std::string& name) const {
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

GoalTopics::GoalTopics(const Options& options, GoalMessageParser wishes, Log& log)
    : options_(*options.goals),
      world_frame_(ros_messages::frame_name(options.world_frame)),
      wishes_(std::move(wishes)),
      log_(log) {
  node_.setCallbackQueue(&queue_);
  // Who comes later hears how the last one ended.
  result_ = node_.advertise<GoalStatus>(options_.result_topic, kGoalQueue, true);
  feedback_ = node_.advertise<GoalStatus>(options_.feedback_topic, kGoalQueue);
  subscribe_goals();
  for (const bool is_static : {false, true}) {
    for (const std::string& topic : is_static ? options_.tf_static_topics : options_.tf_topics) {
      subscribe<ros_messages::TfMessage>(topic, kTfQueue, [this, is_static](const auto& message) {
        (void)ros_messages::add_transforms(message, is_static, tf_);
      });
    }
  }
}

template <class Message, class Callback>
void GoalTopics::subscribe(const std::string& topic, std::uint32_t queue, Callback callback) {
  if (topic.empty()) return;
  using Pointer = boost::shared_ptr<const Message>;
  const boost::function<void(const Pointer&)> call(
      [callback](const Pointer& message) { callback(*message); });
  subscribers_.push_back(node_.subscribe<Message>(topic, queue, call));
}

void GoalTopics::subscribe_goals() {
  using Kind = Wanted::Kind;
  subscribe<ros_messages::PoseStamped>(
      options_.base_pose_topic, kGoalQueue,
      [this](const auto& message) { want(Kind::kBasePose, "base_pose", message); });
  subscribe<ros_messages::PoseStamped>(
      options_.end_effector_topic, kGoalQueue,
      [this](const auto& message) { want(Kind::kEndEffector, "end_effector", message); });
  subscribe<ros_messages::JointState>(
      options_.joints_topic, kGoalQueue,
      [this](const auto& message) { want(Kind::kJoints, "joints", message); });
  subscribe<ros_messages::String>(options_.pose_topic, kGoalQueue, [this](const auto& message) {
    want(Kind::kNamedPose, "pose", message.data);
  });
  subscribe<ros_messages::GoalId>(options_.cancel_topic, kGoalQueue,
                                  [this](const auto& message) { cancel(message.id); });
}

void GoalTopics::want(Wanted::Kind kind, const char* name, decltype(Wanted::message) message) {
  if (wanted_) publish({wanted_->id, State::kReplaced, "another goal came before it began"});
  const std::string id = std::string(name) + "/" + std::to_string(++count_);
  const Stamp now = ros_now();
  received_[id] = now;
  is_cancelled_ = false;
  wanted_ = Wanted{kind, id, now, std::move(message)};
}

/// That of the id, or all where it is empty.
void GoalTopics::cancel(const std::string& id) {
  const bool is_any = id.empty();
  if (wanted_ && (is_any || id == wanted_->id)) {
    publish({wanted_->id, State::kReplaced, "it was cancelled before it began"});
    wanted_.reset();
    if (!is_any) return;
  }
  if (is_any || id == current_) {
    is_cancelled_ = true;
  } else {
    log_.warn("executor ros1: goal " + id + ", which is to be cancelled, is not under way");
  }
}

GoalTopics::Placed GoalTopics::place(const Wanted& wanted, Stamp now) const {
  const auto& message = std::get<ros_messages::PoseStamped>(wanted.message);
  const auto refused = [](std::string why) { return tl::make_unexpected(std::move(why)); };
  const auto pose = ros_messages::pose_of(message);
  if (!pose) return refused("a figure is not finite, or the orientation is no unit quaternion");
  const std::string frame = ros_messages::frame_name(message.header.frame_id);
  if (frame.empty()) return refused("it names no frame");
  if (frame == world_frame_) return pose->transform();
  // A stamp of zero is now, as with tf.
  const Stamp said = ros_messages::to_stamp(message.header.stamp);
  const Stamp stamp = said.ns == 0 ? wanted.received : said;
  const auto T_world_frame = tf_.lookup(world_frame_, frame, stamp, options_.tf_max_gap_s);
  if (T_world_frame) return *T_world_frame * pose->transform();
  const LookupFault fault = T_world_frame.error().fault;
  const bool may_pass = fault == LookupFault::kTooLate || fault == LookupFault::kUnknown ||
                        fault == LookupFault::kNotConnected;
  const double waited_s = 1e-9 * static_cast<double>(now.ns - wanted.received.ns);
  if (may_pass && waited_s < options_.tf_wait_s) return std::nullopt;
  return refused(T_world_frame.error().message);
}

std::optional<Result<Node>> GoalTopics::understand(const Wanted& wanted,
                                                   const Eigen::VectorXd& q_now, Stamp now) const {
  using Kind = Wanted::Kind;
  if (wanted.kind == Kind::kNamedPose) {
    return wishes_.named_pose(std::get<std::string>(wanted.message));
  }
  if (wanted.kind == Kind::kJoints) {
    return wishes_.joints(std::get<ros_messages::JointState>(wanted.message));
  }
  const Placed placed = place(wanted, now);
  if (!placed) return std::nullopt;
  const bool is_base = wanted.kind == Kind::kBasePose;
  if (!*placed) {
    return fail(ErrorCode::kInvalidArgument, placed->error(),
                is_base ? options_.base_pose_topic : options_.end_effector_topic);
  }
  return is_base ? wishes_.base_pose(**placed, q_now) : wishes_.end_effector(**placed, q_now);
}

std::optional<GoalRequest> GoalTopics::next(const Result<Eigen::VectorXd>& q_now, Stamp now) {
  queue_.callAvailable(::ros::WallDuration(0.0));
  tf_.forget_before({now.ns - Stamp::from_seconds(kTransformsKept_s).ns});
  if (is_cancelled_) {
    is_cancelled_ = false;
    return GoalRequest{"cancel/" + std::to_string(++count_), {}};
  }
  if (!wanted_) return std::nullopt;
  auto wish = q_now ? understand(*wanted_, *q_now, now) : Result<Node>(error_of(q_now));
  if (!wish) return std::nullopt;
  const Wanted taken = *std::exchange(wanted_, std::nullopt);
  if (*wish) return GoalRequest{taken.id, std::move(**wish)};
  const GoalReport refusal{taken.id, State::kRefused, wish->error().describe()};
  log_.warn("executor ros1: goal " + taken.id + ": " + text_of(refusal));
  publish(refusal);
  return std::nullopt;
}

void GoalTopics::report(const GoalReport& report) {
  if (report.state == State::kAccepted) current_ = report.id;
  if (is_final(report.state) && report.id == current_) current_.clear();
  publish(report);
}

void GoalTopics::publish(const GoalReport& report) {
  GoalStatus message;
  const auto received = received_.find(report.id);
  const Stamp stamp = received != received_.end() ? received->second : ros_now();
  message.goal_id.id = report.id;
  message.goal_id.stamp = ros_messages::to_ros_time(stamp);
  message.status = status_of(report.state);
  message.text = text_of(report);
  if (!is_final(report.state)) {
    feedback_.publish(message);
    return;
  }
  received_.erase(report.id);
  result_.publish(message);
}

}  // namespace sidestep::ros1_executor
