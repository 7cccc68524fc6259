// Compiled, not run, with clang++ under each sanitizer: a plugin of another compiler gets at least
// as far as a stamp that tells the truth.
#include <string_view>

#include <sidestep/plugin/plugin.hpp>

static_assert(std::string_view(sidestep::detail::kSanitizer) == SANITIZER);
