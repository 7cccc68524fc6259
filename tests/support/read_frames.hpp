#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <sidestep/sensing/source.hpp>

namespace sidestep::testing_support {

/// Frames and errors in the order in which a source hands them out, to its end or `at_most` of
/// them: a source that never ends does not hang a test.
[[nodiscard]] inline std::vector<Result<Frame>> read_frames(Source& source, std::size_t at_most) {
  std::vector<Result<Frame>> frames;
  while (frames.size() < at_most) {
    auto frame = source.next(Deadline());
    if (!frame) {
      frames.emplace_back(tl::unexpect, frame.error());
    } else if (*frame) {
      frames.emplace_back(std::move(**frame));
    } else {
      break;
    }
  }
  return frames;
}

}  // namespace sidestep::testing_support
