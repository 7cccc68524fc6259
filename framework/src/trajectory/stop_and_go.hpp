#pragma once

#include <optional>

#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::detail {

/// The fastest motion along a path that stands still at each of its states, so that its pieces are
/// straight lines, and turns at each between: every line takes a ramp up, a stretch at full speed
/// and a ramp down, each a cubic piece of its own. All that is known in closed form.
///
/// Keeps a share `kept_free` of the limits free. Nothing for all other paths: that pass a state, do
/// not turn at one by as much as `same_direction` (a cosine) tells, have a line shorter than a
/// millionth of them, or a joint that moves with a limit that is zero or infinite.
[[nodiscard]] std::optional<Trajectory> stop_and_go(const Trajectory& path,
                                                    const MotionLimits& limits, double kept_free,
                                                    double same_direction);

}  // namespace sidestep::detail
