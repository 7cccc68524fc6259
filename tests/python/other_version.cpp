// Loaded before the library of Sidestep, it stands for one of another version.
#include <sidestep/runtime/library_version.hpp>

namespace sidestep {

const char* library_version() noexcept { return "9.8.7"; }

}  // namespace sidestep
