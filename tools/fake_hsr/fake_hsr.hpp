#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <sidestep/runtime/truth_check.hpp>

#include "drift.hpp"
#include "robot_body.hpp"
#include "sensors.hpp"
#include "settings.hpp"

namespace sidestep::fake_hsr {

/// A simulated HSR behind the topics of the real one. [main], but for its camera's thread.
class FakeHsr {
 public:
  /// The process is a node of ROS. Fails with kConfig or kNotFound where robot, scene or settings
  /// do not fit.
  [[nodiscard]] static Result<std::unique_ptr<FakeHsr>> create(const Settings& settings);

  /// Until `end` is set.
  void run(const std::atomic<bool>& end);

  /// What the robot touched and when it stood, as JSON; judged by its shapes and the true scene at
  /// 125 Hz.
  [[nodiscard]] Result<std::string> summary() const;

 private:
  struct Controller {
    std::string name;
    JointGroup group;
    ::ros::Publisher state;
    ::ros::Subscriber command;
    std::int64_t commands = 0;
    bool was_silent = false;
  };
  FakeHsr(const Settings& settings, std::shared_ptr<const KinematicTree> robot,
          std::shared_ptr<const Scene> scene, const Eigen::VectorXd& q);

  void connect();
  void on_command(Controller& controller, const ros_messages::JointTrajectory& message);
  void on_twist(const ros_messages::Twist& message);
  void advance(Stamp now);
  /// Says when it begins to move, and when it stands again.
  void note_motion(bool is_moving, Stamp stamp);
  void publish(Stamp now);
  void publish_joint_states(Stamp stamp);
  void publish_odometry(Stamp stamp);
  void publish_transforms(Stamp stamp);
  void publish_static_transforms();
  void publish_controllers(Stamp stamp);
  [[nodiscard]] double scene_time_s(Stamp stamp) const;
  /// Of each part that fell silent: after how long the robot stood still.
  [[nodiscard]] std::string silences_json() const;
  /// Where joints and links are.
  [[nodiscard]] std::string end_json() const;
  [[nodiscard]] bool is_part_silent(const std::string& part) const;

  Settings settings_;
  std::vector<Silence> silences_;
  std::shared_ptr<const KinematicTree> robot_;
  std::shared_ptr<const Scene> scene_;
  std::shared_ptr<RobotMotion> motion_;
  RobotState state_;  ///< As it is measured.
  simulated::Drift drift_;
  Stamp begin_;
  std::atomic<std::int64_t> first_command_ns_{0};  ///< 0: none yet.
  Stamp next_truth_;
  Stamp next_publish_;
  std::vector<TruePose> poses_;
  std::vector<double> speeds_;  ///< Of the fastest joint at each of them.
  Stamp last_moved_;
  bool is_moving_ = false;
  int motions_ = 0;
  std::int64_t refused_commands_ = 0;
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  ::ros::Subscriber twist_;
  std::int64_t twists_ = 0;
  std::vector<std::unique_ptr<Controller>> controllers_;
  std::map<std::string, ::ros::Publisher> publishers_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
  std::unique_ptr<Sensors> sensors_;
};

}  // namespace sidestep::fake_hsr
