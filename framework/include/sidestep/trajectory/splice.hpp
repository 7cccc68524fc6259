#pragma once

#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// The motion between two times of a trajectory, `from_s` its time 0: the same motion up to
/// rounding, since a part of a cubic is one. Times are those within [0, duration]; a part that goes
/// on beyond the end waits there at rest. `to_s` later than `from_s` by more than a microsecond;
/// `trajectory` not empty. [any]; allocates.
[[nodiscard]] Trajectory cut(const Trajectory& trajectory, double from_s, double to_s);

/// `first` and then `second`, which begins where and as fast as `first` ends: the last state of
/// `first` stands for both. Joints agree, neither is empty. [any]; allocates.
[[nodiscard]] Trajectory joined(const Trajectory& first, const Trajectory& second);

/// The last state of a trajectory that is not empty. [any]; allocates.
[[nodiscard]] RobotState end_state(const Trajectory& trajectory);

/// Where a trajectory comes nearest to a configuration.
struct NearestState {
  double time_s = 0.0;
  double off = 0.0;  ///< Largest difference of any joint, m or rad.
};

/// To within 1e-4 of a piece's duration, on the piece that begins or ends with the nearest state;
/// the last of those that are equally near. `trajectory` not empty. [any]; allocates.
[[nodiscard]] NearestState nearest_state(const Trajectory& trajectory, std::span<const double> q);

/// Stands still at `q` for so long. [any]; allocates.
[[nodiscard]] Trajectory resting(std::span<const double> q, double duration_s);

}  // namespace sidestep
