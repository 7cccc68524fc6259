#pragma once

#include <cmath>
#include <span>

#include <sidestep/core/export.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Tolerance on the speed of a rolling base across its wheels, in m/s.
inline constexpr double kSlipTolerance_mps = 1e-6;

/// How a rolling base moves: its velocity in its own frame, in m/s.
struct BaseSpeed {
  double ahead_mps = 0.0;
  double left_mps = 0.0;  ///< Across the wheels: 0 where they roll.

  [[nodiscard]] double length() const noexcept { return std::hypot(ahead_mps, left_mps); }
};
/// q, qdot: one row of the robot's joints. [any]
[[nodiscard]] SIDESTEP_EXPORT BaseSpeed base_speed(const RollingBase& base,
                                                   std::span<const double> q,
                                                   std::span<const double> qdot) noexcept;

/// Where a trajectory's base is fastest across its wheels, and where along them.
struct RollingExtremes {
  double left_mps = 0.0, left_at_s = 0.0;
  double ahead_mps = 0.0, ahead_at_s = 0.0;
};
/// From `from_s` to `to_s`, looked at in each piece nine times.
[[nodiscard]] SIDESTEP_EXPORT RollingExtremes rolling_extremes(const RollingBase& base,
                                                               const Trajectory& trajectory,
                                                               double from_s, double to_s);

/// Makes the base of a trajectory roll: its heading and its speed ahead stay, all but a little, and
/// its positions become what they lead to, so that it still ends where it did; it gets as many more
/// states as it takes to keep to kSlipTolerance_mps between them. False, and nothing is changed,
/// where that does not bring it to its end: where it slips too much. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT bool roll(const RollingBase& base, Trajectory& trajectory);

/// As roll(), with the speeds that states have, even between them; it ends wherever that leads to.
SIDESTEP_EXPORT void roll_freely(const RollingBase& base, Trajectory& trajectory);

}  // namespace sidestep
