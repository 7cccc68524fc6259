#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

struct RetimeSettings {
  /// The path is cut into at least so many stages. The time lost to them falls in proportion to
  /// their length: 0.1 % to 0.5 % of the optimum for 400 of them.
  int least_stages = 400;
  double max_deviation = 1e-4;  ///< From the path, any joint, in m or rad.
  bool stop_at_goal = false;    ///< Comes to rest at the goal, whatever velocity `path` has there.
  bool is_stop = false;         ///< Joints lose speed by the limits' while_stopping().
};

struct Retiming {
  /// States at the ends of the stages, at times of their own: on the path, with its direction.
  Trajectory trajectory;
  /// The largest distance of any joint from the path between those states, in m or rad.
  double deviation = 0.0;
};

/// The fastest motion along the path of `path` within `limits`: time-optimal path parameterisation
/// by two passes of linear programs over the path (Pham and Pham, "A new approach to time-optimal
/// path parameterization based on reachability analysis", 2018; docs/numerics.md). Start and goal
/// are passed at the velocities that `path` has there, unless it is to stop at the goal; the path
/// stands still where it is slower than a thousandth of the speed that it gains in a stage. The
/// result is a trajectory of cubic pieces itself; it keeps velocity and acceleration limits at
/// every instant, and its states lie on the path. Where the path turns on the spot, the robot
/// stops; corners of less than a degree it rounds off within `max_deviation`. A path that stays put
/// takes a millisecond.
///
/// Fails with kInvalidArgument, naming joint and time, for a malformed path or limits that do not
/// fit it, a joint that moves but may not or has no limit at all, and where the path cannot be
/// followed from its start's or to its goal's velocity. [any]; allocates.
[[nodiscard]] Result<Retiming> retime(const Trajectory& path, const MotionLimits& limits,
                                      const RetimeSettings& settings = {});

}  // namespace sidestep
