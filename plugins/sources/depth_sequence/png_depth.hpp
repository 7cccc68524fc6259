#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include <sidestep/core/error.hpp>

namespace sidestep::depth_sequence {

struct ImageSize {
  int width_px = 0;
  int height_px = 0;
  friend bool operator==(const ImageSize&, const ImageSize&) = default;
};

/// Depth as a camera stores it: one 16-bit number a pixel, row by row.
struct RawDepth {
  ImageSize size;
  std::vector<std::uint16_t> values;
};

/// The size of a PNG image of one channel of 16 bits, from its header. Fails with kNotFound,
/// kIo or kBadFrame (another kind of file or image), naming the file.
[[nodiscard]] Result<ImageSize> read_png_size(const std::filesystem::path& file);

/// The whole image. Fails as read_png_size() does, and with kBadFrame where the data are
/// truncated or damaged.
[[nodiscard]] Result<RawDepth> read_png_depth(const std::filesystem::path& file);

}  // namespace sidestep::depth_sequence
