#pragma once

#include <cstdint>
#include <deque>
#include <memory>

#include <sidestep/core/time.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::simulated {

/// A robot of independent joints, each with a limit on its velocity, on how fast it gains speed
/// (acceleration) and on how fast it loses it (braking), that moves in steps of 1 ms. Copies go on
/// independently.
class SimulatedRobot {
 public:
  static constexpr std::int64_t kStep_ns = 1'000'000;

  /// At rest in `q` at the last whole step before `at`. `lag_s`: of the first-order lag with which
  /// the drives see a trajectory. `limits` has values for every joint.
  SimulatedRobot(MotionLimits limits, double lag_s, Eigen::VectorXd q, Stamp at);

  /// Tracks the trajectory, whose time 0 is at `start`, from the step that ends at or after `from`
  /// on. What was to begin then or later is forgotten.
  void follow(std::shared_ptr<const Trajectory> trajectory, Stamp start, Stamp from);
  /// Brakes every joint as hard as it can from then on, and stays where that ends.
  void brake(Stamp from);

  /// Moves on by one step.
  void step();

  [[nodiscard]] Stamp time() const noexcept { return {step_ * kStep_ns}; }
  [[nodiscard]] std::int64_t steps() const noexcept { return step_; }
  [[nodiscard]] const RobotState& state() const noexcept { return state_; }

  /// Where the robot has been told to be at a time from now on; where it brakes, or follows
  /// nothing, where it is then.
  [[nodiscard]] Eigen::VectorXd told_position(Stamp at) const;

 private:
  struct Command {
    std::shared_ptr<const Trajectory> trajectory;  ///< Null: brake and stay.
    Stamp start;
    Stamp from;
  };
  /// What the drives are to do: the trajectory, seen through the lag.
  struct Reference {
    Eigen::VectorXd q;
    Eigen::VectorXd qdot;
  };

  void enqueue(Command command);
  void activate(Command command);
  void track();
  void track_joint(Eigen::Index joint, double reference_q, const Reference& next);
  void brake_joints();
  void roll_to_rest();
  [[nodiscard]] bool is_settled() const;

  MotionLimits limits_;
  double lag_s_;
  std::int64_t step_;
  RobotState state_;
  Command active_;
  std::deque<Command> pending_;  ///< In order of `from`.
  Reference told_;               ///< By the trajectory, at the end of the last step.
  Reference reference_;          ///< At the end of the last step.
  Reference next_;
};

}  // namespace sidestep::simulated
