#pragma once

#include <cstddef>

#include <Eigen/Core>

#include <sidestep/core/large_array.hpp>

namespace sidestep::edt {

/// Values are computed, and changes noted, in tiles of this many voxels along x.
inline constexpr int kTile = 16;

/// One value a voxel, x fastest; rows are padded to whole tiles. All zero at first, and a page of
/// memory costs nothing before it is written.
template <class Value>
class TiledGrid {
 public:
  explicit TiledGrid(const Eigen::Vector3i& size)
      : pitch_((size.x() + kTile - 1) / kTile * kTile),
        // Slices a multiple of 4096 bytes apart would compete for the same few cache lines.
        slice_pitch_(static_cast<std::ptrdiff_t>(size.y()) * pitch_ + 4 * kTile),
        values_(make_large_array<Value>(static_cast<std::size_t>(slice_pitch_) *
                                        static_cast<std::size_t>(size.z()))) {}

  [[nodiscard]] std::ptrdiff_t pitch() const noexcept { return pitch_; }
  [[nodiscard]] std::ptrdiff_t slice_pitch() const noexcept { return slice_pitch_; }
  [[nodiscard]] Value* row(int y, int z) noexcept { return values_.get() + offset(y, z); }
  [[nodiscard]] const Value* row(int y, int z) const noexcept {
    return values_.get() + offset(y, z);
  }

 private:
  [[nodiscard]] std::ptrdiff_t offset(int y, int z) const noexcept {
    return y * pitch_ + z * slice_pitch_;
  }

  std::ptrdiff_t pitch_;
  std::ptrdiff_t slice_pitch_;
  LargeArray<Value> values_;
};

}  // namespace sidestep::edt
