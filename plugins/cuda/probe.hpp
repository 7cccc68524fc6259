#pragma once

namespace sidestep::cuda {

/// A kernel that does nothing, compiled as all others are: whether the device has code for it tells
/// whether it has any for them.
[[nodiscard]] const void* probe_kernel();

}  // namespace sidestep::cuda
