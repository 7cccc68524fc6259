#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Follows the path of a trajectory from its state at `from_s`, and comes to rest as soon as the
/// limits of stops allow (while_stopping()): the same path, ever more slowly (retime.hpp: within
/// 1e-4 of it, time-optimal over 1.0005 of the way that braking hardest takes, more where the
/// path's turns ask for more). Its first state is exactly the trajectory's at `from_s`; a joint
/// that is faster there than its limit may stay so until it has slowed down. Where the velocity is
/// zero already, it rests; where the trajectory itself rests on its way, at a corner, it goes no
/// further.
///
/// Fails with kInvalidArgument for a malformed trajectory, limits that do not fit it, and where the
/// path ends or turns before the limits let the robot stop: brake_straight() then still stops,
/// beside the path. [any]; allocates.
[[nodiscard]] Result<Trajectory> brake(const Trajectory& trajectory, double from_s,
                                       const MotionLimits& limits);

/// Comes to rest along a straight line in joint space (the base of a rolling robot on an arc, all
/// but), all joints slowing down evenly and together:
/// max |v| / a, with the limits of stops, is the time it takes, and half of that time's way at full
/// speed is its length. Fails with kInvalidArgument where sizes disagree, a value is not finite, or
/// a joint that moves may not be slowed down. [any]; allocates.
[[nodiscard]] Result<Trajectory> brake_straight(const RobotState& state,
                                                const MotionLimits& limits);

}  // namespace sidestep
