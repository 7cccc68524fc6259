#pragma once

#include <cstdint>

namespace sidestep::incremental {

/// The way from a voxel to an obstacle, in voxels, packed into 32 bits so that a step to a
/// neighbour is one addition. |x|, |y| <= kLargestXY and |z| <= kLargestZ; all bits zero are no
/// offset.
struct Offset {
  static constexpr int kLargestXY = 1023;
  static constexpr int kLargestZ = 511;

  std::uint32_t bits = 0;

  [[nodiscard]] static constexpr Offset of(int x, int y, int z) noexcept {
    return {kZero + difference(x, y, z)};
  }
  /// What adding (x, y, z) to an offset adds to its bits.
  [[nodiscard]] static constexpr std::uint32_t difference(int x, int y, int z) noexcept {
    return static_cast<std::uint32_t>(x) + (static_cast<std::uint32_t>(y) << kShiftY) +
           (static_cast<std::uint32_t>(z) << kShiftZ);
  }

  [[nodiscard]] constexpr bool exists() const noexcept { return bits != 0; }
  [[nodiscard]] constexpr int x() const noexcept {
    return static_cast<int>(bits & 0x7ffu) - (kLargestXY + 1);
  }
  [[nodiscard]] constexpr int y() const noexcept {
    return static_cast<int>(bits >> kShiftY & 0x7ffu) - (kLargestXY + 1);
  }
  [[nodiscard]] constexpr int z() const noexcept {
    return static_cast<int>(bits >> kShiftZ) - (kLargestZ + 1);
  }

 private:
  static constexpr unsigned kShiftY = 11;
  static constexpr unsigned kShiftZ = 22;
  static constexpr std::uint32_t kZero = static_cast<std::uint32_t>(kLargestXY + 1) |
                                         static_cast<std::uint32_t>(kLargestXY + 1) << kShiftY |
                                         static_cast<std::uint32_t>(kLargestZ + 1) << kShiftZ;
};

}  // namespace sidestep::incremental
