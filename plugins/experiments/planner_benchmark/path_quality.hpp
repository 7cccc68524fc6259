#pragma once

#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Length of a trajectory's support states joined by straight lines, in the space of joints, rad
/// and m alike. [any]
[[nodiscard]] double path_length(const Trajectory& trajectory);

/// How far a trajectory is from the smoothest one of its length L and duration T: the integral of
/// its squared acceleration over all joints as a multiple of 12 L^2 / T^3, which a straight motion
/// from rest to rest needs at least. 1 at best where it begins and ends at rest, about 4/3 at
/// constant acceleration there and back, 4 with a stop half way; without unit. Accelerations are
/// means over a thousandth of T, so that what lasts shorter (a velocity that jumps by a rounding
/// error) counts by the change of velocity that it brings. 0 where nothing moves. [any]
[[nodiscard]] double acceleration_ratio(const Trajectory& trajectory);

}  // namespace sidestep
