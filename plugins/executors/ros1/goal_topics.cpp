#include "goal_topics.hpp"

#include <cmath>

#include <boost/function.hpp>

#include "figures.hpp"

namespace sidestep::ros1_executor {
namespace {

using State = GoalReport::State;
using ros_messages::GoalStatus;
using ros_messages::LookupFault;

constexpr std::uint32_t kGoalQueue = 10;
constexpr std::uint32_t kTfQueue = 1000;
/// Of tf.
constexpr double kTransformsKept_s = 10.0;

Stamp ros_now() { return ros_messages::to_stamp(::ros::Time::now()); }

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

GoalTopics::GoalTopics(const Options& options, GoalWishes wishes, Log& log)
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
