#pragma once

#include <memory>

#include <sidestep/plugin/context.hpp>
#include <sidestep/sensing/source.hpp>

#include "options.hpp"

namespace sidestep::rosbag {

/// The frames of a bag. Goes through the whole bag once, for everything but images and clouds.
/// Fails as Bag::open(), read_recording() and Viewpoints::create() do.
///
/// A frame that cannot be made (no pose, a damaged message) fails with kBadFrame, and the next call
/// goes on; after the last frame each place where the bag is damaged fails so once, naming the byte
/// and the time.
[[nodiscard]] Result<std::unique_ptr<Source>> create_source(const Options& options,
                                                            const HostContext& context);

}  // namespace sidestep::rosbag
