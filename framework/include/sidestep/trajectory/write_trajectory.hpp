#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Writes a trajectory for other programs, and for `sidestep certify`; what the file ends in says
/// how. `.csv`: `time_s`, then the joints by name (m, rad), then `JOINT.velocity` of each, with
/// every digit. `.json` (and `.yaml`, of which JSON is a part): MoveIt's RobotTrajectory, its times
/// in whole nanoseconds. `joints` has a name for each of the trajectory's. Its folder
/// is made, and a file that is there replaced. Fails with kInvalidArgument for another ending,
/// names that do not fit and a trajectory that is not valid, and with kIo where the file cannot be
/// written. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT Result<void> write_trajectory(const Trajectory& trajectory,
                                                            const std::vector<std::string>& joints,
                                                            const std::filesystem::path& file);

}  // namespace sidestep
