#pragma once

#include <memory>

#include <sidestep/plugin/context.hpp>
#include <sidestep/sensing/source.hpp>

#include "options.hpp"

namespace sidestep::simulator {

/// A depth camera that moves along a path through a scene; implements GroundTruth, too. Fails
/// with kNotFound or kConfig where the scene or the parameters are wrong.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::simulator
