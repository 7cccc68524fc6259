#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// A path of straight lines with its corners rounded off: each by the parabola that leaves its line
/// `reach` before the corner and joins the next one as far behind it, or half of the shorter line
/// away, whichever is nearer. What is cut off lies within the triangle of those two points and the
/// corner, and passes it at a quarter of |b - a| times that distance, with a and b the directions
/// of the lines (Kunz and Stilman, "Time-optimal trajectory generation for path following with
/// bounded acceleration and velocity", 2012, have circles there).
///
/// `path` stands still at its states (as those that sampling planners make do), two that follow on
/// each other apart; `reach` is in m and rad, over all joints. The result moves at unit speed at
/// most, from rest to rest, and only serves as a path, for retime(). It does not stop but where the
/// path turns back on itself.
///
/// Fails with kInvalidArgument for a path that is not sound, moves at a state or has fewer than
/// two, or two alike, and for a reach that is not positive. [any]; allocates.
[[nodiscard]] Result<Trajectory> blend_corners(const Trajectory& path, double reach);

}  // namespace sidestep
