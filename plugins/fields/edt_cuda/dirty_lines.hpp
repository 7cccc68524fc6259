#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "line_kernels.hpp"

namespace sidestep::edt_cuda {

/// What each pass has to bring up to date.
struct DirtyLines {
  std::vector<std::int32_t> rows;  ///< Of blocks, as ScanRows::items.
  std::vector<LinePart> along_y;
  std::vector<LinePart> along_z;
};

/// What a change of obstacles can reach, pass by pass. A value along x changes only in a changed
/// block's own rows, one along y only in its slices, and none farther away than the reach of the
/// cap along the axes passed.
class DirtyRegion {
 public:
  /// `reach`: the largest offset whose square is below the cap.
  DirtyRegion(const Shape& shape, int reach);

  /// All that the change of these blocks can reach. Valid until the next call.
  [[nodiscard]] const DirtyLines& of(std::span<const std::int32_t> blocks);
  [[nodiscard]] const DirtyLines& everything();

 private:
  /// Places [first, last] along an axis, in units of several voxels.
  struct Range {
    int first, last;
  };
  [[nodiscard]] Range reached(int block, int length, int unit) const;
  void mark(std::int32_t block);

  Shape shape_;
  int reach_;
  int tiles_, segments_y_, segments_z_;
  std::vector<std::uint8_t> rows_, along_y_, along_z_;
  DirtyLines lines_;
};

}  // namespace sidestep::edt_cuda
