#pragma once

#include <cstdint>
#include <memory>

#include <sidestep/sensing/source.hpp>

#include "options.hpp"

namespace sidestep::pcd {

/// Opens a file or folder of point clouds. Fails with kNotFound where there is none, kConfig where
/// the options or the file of poses are wrong. `seed` decides what the plane filter tries.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            std::uint64_t seed);

}  // namespace sidestep::pcd
