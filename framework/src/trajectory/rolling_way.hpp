#pragma once

#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/rolling.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::detail {

/// A path with a joint more, last: the way of a rolling base ahead, in m. What limits the joints of
/// a motion so limits the base's speed along its wheels, too.
[[nodiscard]] Trajectory with_way(const Trajectory& path, const RollingBase& base);
/// The limits of the joints of such a path: the last one's are those of `rolling`'s x.
[[nodiscard]] MotionLimits with_way(MotionLimits limits);
/// Without that joint.
[[nodiscard]] Trajectory without_way(const Trajectory& with);

}  // namespace sidestep::detail
