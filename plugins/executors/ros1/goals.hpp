#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/planning/goal_source.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "conversions.hpp"
#include "histories.hpp"
#include "node_messages.hpp"
#include "ros1_executor.hpp"

namespace sidestep::ros1_executor {

/// A link that is to be somewhere.
struct Reach {
  int link = 0;
  Transform T_world_target = Transform::Identity();
  bool turns = true;  ///< Whether its rotation counts.
};

/// From where a search for a posture that reaches begins: of the posture that the robot has and
/// those that its profile names, the one that comes nearest once its base, if it has one, stands
/// and is turned as suits best. Such a search finds what is near; from afar, it ends anywhere. What
/// is in the way is not asked. The base stays in `keep_in` where there is a posture for which it
/// can. Within the joints' limits. Pure; allocates. [any]
[[nodiscard]] Eigen::VectorXd reach_seed(const RobotModel& robot, const Reach& reach,
                                         const std::optional<OdometryOptions>& base,
                                         const std::optional<KeepInBox>& keep_in,
                                         const Eigen::VectorXd& q_now);

/// Turns what messages say of where the robot is to be into wishes as a GoalRequest has them.
/// Failures are kInvalidArgument, with the topic and what is wrong. What depends on the robot
/// alone, its joints' names and limits and its named poses, is left to whoever reads the wish.
/// [any]
class GoalMessageParser {
 public:
  /// `options` with goals. Fails with kConfig where the robot lacks the link of `goals`; has the
  /// joints of `odometry`, as JointFeed has found.
  [[nodiscard]] static Result<GoalMessageParser> create(std::shared_ptr<const RobotModel> robot,
                                                        const Options& options);

  /// The base is to be at a pose of the world; the other joints stay. Of the turns that yaw may
  /// mean, the one nearest to `q_now`. Fails where the pose is not level or out of keep_in, and
  /// where there is no odometry.
  [[nodiscard]] Result<Node> base_pose(const Transform& T_world_goal,
                                       const Eigen::VectorXd& q_now) const;
  /// The link is to be at a pose of the world; where the robot stands then is free. The search for
  /// a posture begins with reach_seed().
  [[nodiscard]] Result<Node> end_effector(const Transform& T_world_goal,
                                          const Eigen::VectorXd& q_now) const;
  /// Positions by name; joints left out stay. Fails where a name stands there twice, lacks a
  /// position or has one that is not finite, and where the base would be out of keep_in.
  [[nodiscard]] Result<Node> joints(const ros_messages::JointState& message) const;
  /// A pose of the robot's profile. Fails where it takes the base out of keep_in.
  [[nodiscard]] Result<Node> named_pose(const std::string& name) const;

 private:
  using Positions = std::map<std::string, double>;
  GoalMessageParser() = default;
  [[nodiscard]] Result<void> check_box(const std::string& topic, const Positions& positions) const;
  /// The block `goal` of a wish.
  [[nodiscard]] static Node goal_block(const std::string& topic, const Positions& positions);
  [[nodiscard]] static Node state_wish(const std::string& topic, const Positions& positions);

  std::shared_ptr<const RobotModel> robot_;
  GoalOptions topics_;
  std::optional<OdometryOptions> odometry_;
  std::optional<KeepInBox> keep_in_;
  int link_ = -1;  ///< The end effector's.
  int yaw_ = -1;
};

/// The topics on which goals come and on which whoever sent them hears what becomes of them. A goal
/// in another frame than the world's waits for tf of its stamp, `tf_wait_s` at most; of goals that
/// come faster than they are taken, the last counts. Messages come in while next() runs. One thread
/// at a time.
class GoalTopics {
 public:
  /// The process is a node of ROS. `log` outlives this.
  GoalTopics(const Options& options, GoalMessageParser wishes, Log& log);
  GoalTopics(const GoalTopics&) = delete;
  GoalTopics& operator=(const GoalTopics&) = delete;

  /// The newest goal that is understood; those that are not have been refused. Never waits.
  /// `q_now`: where the robot is; why that is not known, and goals are refused. `now`: ROS time.
  [[nodiscard]] std::optional<GoalRequest> next(const Result<Eigen::VectorXd>& q_now, Stamp now);

  /// Publishes it.
  void report(const GoalReport& report);

 private:
  /// What a message said, until it is understood.
  struct Wanted {
    enum class Kind : std::uint8_t { kBasePose, kEndEffector, kJoints, kNamedPose };
    Kind kind = Kind::kNamedPose;
    std::string id;
    Stamp received;  ///< ROS time.
    std::variant<ros_messages::PoseStamped, ros_messages::JointState, std::string> message;
  };
  /// A goal's transform into the world, or why there is none; nothing where tf is waited for.
  using Placed = std::optional<tl::expected<Transform, std::string>>;

  template <class Message, class Callback>
  void subscribe(const std::string& topic, std::uint32_t queue, Callback callback);
  void subscribe_goals();
  void want(Wanted::Kind kind, const char* name, decltype(Wanted::message) message);
  void cancel(const std::string& id);
  [[nodiscard]] Placed place(const Wanted& wanted, Stamp now) const;
  /// Nothing where tf is waited for.
  [[nodiscard]] std::optional<Result<Node>> understand(const Wanted& wanted,
                                                       const Eigen::VectorXd& q_now,
                                                       Stamp now) const;
  void publish(const GoalReport& report);

  GoalOptions options_;
  std::string world_frame_;
  GoalMessageParser wishes_;
  Log& log_;
  ros_messages::TfTree tf_;
  std::optional<Wanted> wanted_;
  bool is_cancelled_ = false;
  std::string current_;                    ///< The goal that the robot is on its way to.
  std::map<std::string, Stamp> received_;  ///< Of goals of which no end has been told.
  std::int64_t count_ = 0;
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  std::vector<::ros::Subscriber> subscribers_;
  ::ros::Publisher feedback_;
  ::ros::Publisher result_;
};

}  // namespace sidestep::ros1_executor
