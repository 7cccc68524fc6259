#include "recording.hpp"

namespace sidestep {

Result<std::unique_ptr<Recording>> open_recording(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    return fail(ErrorCode::kNotFound, "there is no such file", file.string());
  }
  return fail(ErrorCode::kUnsupported, "this build of Sidestep reads no recordings", file.string());
}

}  // namespace sidestep
