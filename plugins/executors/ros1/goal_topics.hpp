#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/goal_source.hpp>

#include "goal_wishes.hpp"
#include "node_messages.hpp"
#include "tf_tree.hpp"

namespace sidestep::ros1_executor {

/// The topics on which goals come and on which whoever sent them hears what becomes of them. A goal
/// in another frame than the world's waits for tf of its stamp, `tf_wait_s` at most; of goals that
/// come faster than they are taken, the last counts. Messages come in while next() runs. One thread
/// at a time.
class GoalTopics {
 public:
  /// The process is a node of ROS. `log` outlives this.
  GoalTopics(const Options& options, GoalWishes wishes, Log& log);
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
  GoalWishes wishes_;
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
