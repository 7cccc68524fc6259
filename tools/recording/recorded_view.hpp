#pragma once

#include <filesystem>
#include <memory>

#include "view_message.hpp"

namespace sidestep {

/// The messages to the viewer's page in the bag of a recorded run. Fails with kNotFound where there
/// is no such file, with kIo where it is no bag that can be read, with kUnsupported where it is not
/// of a run of Sidestep.
[[nodiscard]] Result<std::unique_ptr<Recording>> open_recording(const std::filesystem::path& file);

}  // namespace sidestep
