#pragma once

#include <array>
#include <cstdint>

#include <sidestep/geometry/grid.hpp>

namespace sidestep::esdf {

/// The 26 neighbours of voxels that are stored block by block: where they are found, and how far
/// away they lie. Blocks are kBlockSide_vox^3 voxels, x fastest, and follow each other in the
/// same order in a volume of `blocks`. Neighbours of the volume's outermost voxels do not exist.
class Neighbours {
 public:
  static constexpr int kCount = 26;

  Neighbours(const Eigen::Vector3i& blocks, double resolution_m);

  /// Index of a voxel's neighbours relative to its own, by direction.
  [[nodiscard]] const std::array<std::int32_t, kCount>& offsets(std::uint32_t voxel) const {
    return offsets_[place_[voxel % kVoxelsPerBlock]];
  }
  /// Metres to the neighbours: 1, sqrt(2) or sqrt(3) voxels.
  [[nodiscard]] const std::array<float, kCount>& steps_m() const noexcept { return steps_m_; }
  /// One of -1, 0 and 1 along each axis.
  [[nodiscard]] const Eigen::Vector3i& direction(int d) const noexcept {
    return directions_[static_cast<std::size_t>(d)];
  }
  [[nodiscard]] static int opposite(int d) noexcept { return kCount - 1 - d; }

 private:
  static constexpr std::uint32_t kVoxelsPerBlock = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  static constexpr int kPlaces = 27;  ///< Low, middle or high end of a block along each axis.

  std::array<Eigen::Vector3i, kCount> directions_;
  std::array<float, kCount> steps_m_;
  std::array<std::array<std::int32_t, kCount>, kPlaces> offsets_;
  std::array<std::uint8_t, kVoxelsPerBlock> place_;
};

}  // namespace sidestep::esdf
