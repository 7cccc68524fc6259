#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep::recorded_frames {

/// What is done with a line: its words, and `file:line` for messages.
using HandleWords =
    std::function<Result<void>(const std::vector<std::string>& words, const std::string& where)>;

/// Hands over each line that is more than a comment (from # on) and white space, until one fails.
/// Fails with that, or with kNotFound. [any]; allocates.
[[nodiscard]] Result<void> for_each_line(const std::filesystem::path& file,
                                         const HandleWords& handle);

}  // namespace sidestep::recorded_frames
