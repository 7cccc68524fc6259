#pragma once

#include <memory>

#include <sidestep/core/log.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/sensing/source.hpp>

#include "options.hpp"

namespace sidestep::depth_sequence {

/// Opens a recorded sequence. Fails with kNotFound where the folder or a layout that is
/// understood is missing, kConfig where intrinsics or world.yaml are wrong.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options, Log& log,
                                                            const DocumentReader& documents);

}  // namespace sidestep::depth_sequence
