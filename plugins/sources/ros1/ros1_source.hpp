#pragma once

#include <memory>

#include <sidestep/plugin/context.hpp>
#include <sidestep/sensing/source.hpp>

#include "options.hpp"

namespace sidestep::ros1_source {

/// A camera behind ROS 1. Waits for the master and a first frame whose pose is known. Fails with
/// kConfig where robot and options do not fit, with kNotFound where something is not there in time,
/// saying what.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::ros1_source
