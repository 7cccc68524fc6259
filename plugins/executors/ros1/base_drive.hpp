#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>

#include "commands.hpp"
#include "robot_link.hpp"
#include "ros1_executor.hpp"

namespace sidestep::ros1_executor {

/// Speeds of a base in its own frame: m/s along x and y, rad/s about z.
using BaseSpeeds = Eigen::Vector3d;

/// How a base is kept on what it was told.
struct BaseTracking {
  bool rolls = false;       ///< On two wheels: it does not move along its y.
  double gain_per_s = 1.5;  ///< With which an error decays.
  BaseSpeeds fastest;       ///< Both ways, each above 0.
};

/// The speeds that bring a base from `measured` onto `told`, both in one frame, and keep it on its
/// way. A holonomic base gets what it was told and the error times the gain. One that rolls is
/// steered by its error across: with feedback scheduled by its speed (de Luca, Oriolo, Samson,
/// "Feedback control of a nonholonomic car-like robot", 1998, for a unicycle), critically damped
/// from a fifth of its top speed on; at rest, an error across stays. Too fast, all speeds are
/// reduced by one factor, so that the way bends as much. Pure. [any]
[[nodiscard]] BaseSpeeds tracking_speeds(const PlanarMotion& told, const PlanarMotion& measured,
                                         const BaseTracking& tracking);

/// What speeds a base gets along what it was told, by where it was measured. All stamps are of one
/// clock that never jumps. One thread at a time.
class BaseFollower {
 public:
  /// `joints`: the robot's, along x and y and about z. Odometry as old as `max_age_s`, and a base
  /// as far off as `tolerance` (m or rad), is not steered by: the base gets the speeds that it was
  /// told, and does not cut across to where it should be.
  BaseFollower(std::array<int, 3> joints, const BaseTracking& tracking, double max_age_s,
               double tolerance);

  /// A motion of the whole robot, whose time 0 is at `start`; until then, what was told before goes
  /// on.
  void follow(Trajectory motion, Stamp start);
  /// The base is to stand, wherever it is.
  void hold();
  void measure(const PlanarMotion& base, Stamp when);
  /// `now` never goes back. Zero for half a second after a motion's end or hold(); then nothing, so
  /// that others may drive.
  [[nodiscard]] std::optional<BaseSpeeds> speeds_at(Stamp now);

 private:
  std::array<int, 3> joints_;
  BaseTracking tracking_;
  double max_age_s_;
  double tolerance_;
  CommandedMotion told_, next_;
  std::optional<PlanarMotion> measured_;
  Stamp measured_at_;
  bool was_driven_ = false;  ///< When last asked, or to be told to stand.
  Stamp silent_from_;
};

/// Sends a base what a BaseFollower says, as geometry_msgs/Twist, from a thread of its own: it goes
/// on to the end of what it was told, a stop, while nobody else has time. [any]
class BaseDrive {
 public:
  /// The process is a node of ROS. `options` with twist and odometry; fails with kConfig where the
  /// robot lacks the joints of odometry, or one of them has no velocity limit.
  [[nodiscard]] static Result<std::unique_ptr<BaseDrive>> create(const RobotDescription& robot,
                                                                 const Options& options);
  /// Waits until nothing is sent any more: half a second after the end of what the base was told.
  ~BaseDrive();
  BaseDrive(const BaseDrive&) = delete;
  BaseDrive& operator=(const BaseDrive&) = delete;

  /// As BaseFollower does; `start`: ROS time, 0 is now.
  void follow(Trajectory motion, Stamp start);
  void hold();
  /// The topic, where nobody listens to it.
  [[nodiscard]] std::optional<std::string> deaf_topic() const;

 private:
  BaseDrive(const Options& options, BaseFollower follower);
  void run(const std::stop_token& stop);

  double rate_hz_;
  std::mutex mutex_;
  BaseFollower follower_;  ///< On the steady clock; guarded by mutex_.
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  ::ros::Publisher twist_;
  ::ros::Subscriber subscriber_;
  std::jthread thread_;
};

}  // namespace sidestep::ros1_executor
