#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Moves a robot, real or simulated.
class SIDESTEP_EXPORT Executor {
 public:
  virtual ~Executor() = default;

  struct Measured {
    RobotState state;
    Stamp stamp;
  };
  /// The newest measured state. [planning]
  [[nodiscard]] virtual Result<Measured> current() = 0;

  /// Takes over the trajectory, whose time 0 is at `start`, from whatever is being followed.
  /// Fails where the robot cannot follow it; the previous one then goes on. [planning]
  [[nodiscard]] virtual Result<void> follow(const Trajectory& trajectory, Stamp start) = 0;

  /// Brings the robot to rest within its acceleration limits. [any]
  [[nodiscard]] virtual Result<void> stop() = 0;
};

}  // namespace sidestep
