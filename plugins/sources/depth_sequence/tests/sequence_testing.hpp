#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sidestep::depth_sequence::testing {

/// What kind of PNG write_png() makes.
struct PngKind {
  int bits = 16;
  int colour_type = 0;  ///< As PNG counts: 0 grey, 2 RGB, 6 RGBA.
  bool interlaced = false;
};

/// Writes `values` row by row; of other kinds than 16-bit grey, an image of that size.
void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint16_t>& values, PngKind kind = {});

std::string read_file(const std::filesystem::path& file);

}  // namespace sidestep::depth_sequence::testing
