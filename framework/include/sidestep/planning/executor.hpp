#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/head.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Moves a robot, real or simulated. Reports what it measures and what it follows to the
/// RobotMotion that its HostContext lends it. A parameter `start` of an executor, a Node, is given
/// a map of joint names to positions (m, rad) by experiments that say where the robot stands at
/// first; without it they begin where its robot is, and warn of that where time is simulated.
class SIDESTEP_EXPORT Executor {
 public:
  virtual ~Executor() = default;

  struct Measured {
    RobotState state;
    Stamp stamp;
  };
  /// The newest measured state. [planning]
  [[nodiscard]] virtual Result<Measured> current() = 0;

  /// Takes over the trajectory, whose time 0 is at `start`: from then on in place of what is being
  /// followed, at once where `start` has passed. Fails where the robot cannot follow it; what was
  /// followed before then goes on. [planning]
  [[nodiscard]] virtual Result<void> follow(const Trajectory& trajectory, Stamp start) = 0;

  /// Brings the robot to rest within its limits of braking (Joint::braking()). [any]
  [[nodiscard]] virtual Result<void> stop() = 0;
};

/// Optional interface of an executor: the head of its robot (RobotDescription::head). Where it is,
/// the executor reports to the RobotMotion that its HostContext lends it.
class SIDESTEP_EXPORT HeadTurner {
 public:
  virtual ~HeadTurner() = default;
  /// Turns the head, from now on, to angles within its limits, as fast as it can, and holds it
  /// there; returns at once. Fails, and the head goes on as it was, where it has none or cannot
  /// turn. [planning]
  [[nodiscard]] virtual Result<void> turn_head(const HeadAngles& to) = 0;
};

/// Optional interface of an executor: the exact state of its robot.
class SIDESTEP_EXPORT TrueRobot {
 public:
  virtual ~TrueRobot() = default;
  /// The robot's true state at a time of the run's clock. [planning]
  [[nodiscard]] virtual RobotState true_state(Stamp stamp) = 0;
};

}  // namespace sidestep
