#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// What a file may be large at most, unless its reader says otherwise.
inline constexpr std::uintmax_t kMostFileBytes = std::uintmax_t{64} << 20;

/// All bytes of a regular file. Fails with kNotFound where there is none, with kIo where it is a
/// folder, a pipe or a device, is larger than `limit_bytes`, or cannot be read. [any]
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& file,
                                            std::uintmax_t limit_bytes = kMostFileBytes);

/// Replaces a file as a whole: whoever reads it meanwhile, and who finds it after a process or the
/// machine ended meanwhile, has the old one or the new one. Fails with kIo. [any]
[[nodiscard]] Result<void> write_file(const std::filesystem::path& file, std::string_view text);

}  // namespace sidestep
