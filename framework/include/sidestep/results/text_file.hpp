#pragma once

#include <filesystem>
#include <string>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// All bytes of a file. Fails with kNotFound where it cannot be opened, kIo where it cannot be
/// read.
[[nodiscard]] Result<std::string> read_file(const std::filesystem::path& file);
/// Replaces the file. Fails with kIo.
[[nodiscard]] Result<void> write_file(const std::filesystem::path& file, const std::string& text);

}  // namespace sidestep
