#pragma once

#include <string>

#include <sidestep/core/error.hpp>

#include "master_probe.hpp"

namespace sidestep::ros1_node {

/// Makes this process a node of ROS called `name` and a number, if it is none yet, and returns a
/// probe of the master that has answered. Signals stay the program's own. Fails with kConfig where
/// ROS_MASTER_URI is missing or malformed, with kNotFound where no master answers there within
/// `patience_s`. [main]; waits.
[[nodiscard]] Result<MasterProbe> join_ros(double patience_s, double probe_period_s,
                                           const std::string& name = "sidestep");

}  // namespace sidestep::ros1_node
