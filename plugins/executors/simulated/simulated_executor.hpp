#pragma once

#include <memory>

#include <sidestep/planning/executor.hpp>
#include <sidestep/plugin/context.hpp>

#include "options.hpp"

namespace sidestep::simulated {

/// A simulated robot on the host's clock; implements TrueRobot, too. Fails with kUnsupported where
/// the run has no robot, with kConfig where the start is not one of the robot's configurations.
[[nodiscard]] Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::simulated
