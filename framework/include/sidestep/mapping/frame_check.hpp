#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Whether a frame can be integrated at all: a rigid, finite T_world_camera, and, for a depth
/// image, sizes above zero, positive finite focal lengths and as many depths as pixels.
/// Fails with kBadFrame, naming the frame's sequence number and what is wrong. Pixels without
/// a measurement are no fault. [any]; does not allocate unless it fails.
[[nodiscard]] Result<void> check_frame(const Frame& frame);

/// The kBadFrame error for a frame. [any]
[[nodiscard]] Error bad_frame(const Frame& frame, std::string message, std::string hint = {});

}  // namespace sidestep
