#pragma once

namespace sidestep {

/// The version of the library that is loaded, e.g. "0.1.0"; it may be another one than that of the
/// headers. [any]
[[nodiscard]] const char* library_version() noexcept;

}  // namespace sidestep
