#pragma once

#include <memory>

#include <sidestep/planning/executor.hpp>
#include <sidestep/plugin/context.hpp>

#include "options.hpp"

namespace sidestep::ros1_executor {

/// A robot behind ROS 1. Waits for the master and a first state of all joints. Fails with
/// kUnsupported where the run has no robot, with kConfig where robot and options do not fit, with
/// kNotFound where no master or no state is there in time.
[[nodiscard]] Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::ros1_executor
