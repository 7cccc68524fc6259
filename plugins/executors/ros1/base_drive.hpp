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

/// Drives a base by geometry_msgs/Twist along what it was told, by odometry, from a thread of its
/// own: it goes on to the end of what it was told, a stop, while nobody else has time. Without
/// odometry younger than `max_odometry_age_s`, or farther off than `start_tolerance`, it gets the
/// speeds that it was told: it does not cut across to where it should be. Half a second
/// after the end, nothing is sent any more, so that others may drive. [any]
class BaseDrive {
 public:
  /// The process is a node of ROS. `options` with twist and odometry, whose joints the robot has;
  /// fails with kConfig where it lacks them, or one of them has no velocity limit.
  [[nodiscard]] static Result<std::unique_ptr<BaseDrive>> create(const RobotDescription& robot,
                                                                 const Options& options);
  /// Waits for the end of what the base was told.
  ~BaseDrive();
  BaseDrive(const BaseDrive&) = delete;
  BaseDrive& operator=(const BaseDrive&) = delete;

  /// A motion of the whole robot, whose time 0 is at `start`, ROS time; until then, what was told
  /// before goes on.
  void follow(Trajectory motion, Stamp start);
  /// The base is told to stand, wherever it is.
  void hold();
  /// The topic, where nobody listens to it.
  [[nodiscard]] std::optional<std::string> deaf_topic() const;

 private:
  BaseDrive(const Options& options, std::array<int, 3> joints, const BaseTracking& tracking);
  void run(const std::stop_token& stop);
  /// What to send; nothing where all has ended.
  [[nodiscard]] std::optional<BaseSpeeds> speeds_at(Stamp now);

  std::array<int, 3> joints_;  ///< Along x and y, and about z.
  BaseTracking tracking_;
  double rate_hz_;
  double max_age_s_;
  double tolerance_;
  std::mutex mutex_;
  CommandedMotion told_, next_;           ///< By ROS time; guarded by mutex_.
  bool holds_ = false;                    ///< Guarded by mutex_.
  std::optional<PlanarMotion> odometry_;  ///< The thread's.
  Stamp measured_;                        ///< When that was.
  Stamp ended_;                           ///< The thread's.
  ::ros::CallbackQueue queue_;
  ::ros::NodeHandle node_;
  ::ros::Publisher twist_;
  ::ros::Subscriber subscriber_;
  std::jthread thread_;
};

}  // namespace sidestep::ros1_executor
