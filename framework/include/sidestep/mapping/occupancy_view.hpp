#pragma once

#include <cstdint>
#include <span>

#include <sidestep/core/export.hpp>
#include <sidestep/geometry/grid.hpp>

namespace sidestep {

/// One bit a voxel. Row (j, k) is `words_per_row` words from word (j + ny * k) * words_per_row
/// on; bit i % 64 of its word i / 64 is voxel (i, j, k); bits beyond the row's end are 0.
struct VoxelBits {
  std::span<const std::uint64_t> words;
  int words_per_row = 0;

  [[nodiscard]] bool at(const GridSpec& grid, const Eigen::Vector3i& voxel) const noexcept {
    const std::size_t row =
        static_cast<std::size_t>(voxel.y()) +
        static_cast<std::size_t>(grid.size_vox.y()) * static_cast<std::size_t>(voxel.z());
    const std::uint64_t word = words[row * static_cast<std::size_t>(words_per_row) +
                                     static_cast<std::size_t>(voxel.x()) / 64];
    return ((word >> (static_cast<unsigned>(voxel.x()) % 64u)) & 1u) != 0;
  }
};

/// A view that a Mapper may offer (dynamic_cast from it): occupancy on a dense grid. Valid
/// until the next integrate(). [mapping]
class SIDESTEP_EXPORT OccupancyView {
 public:
  /// What a plugin that offers or needs the view declares, and messages call it.
  static constexpr const char* kViewName = "occupancy";

  virtual ~OccupancyView() = default;
  /// The mapper's grid().
  [[nodiscard]] virtual const GridSpec& occupancy_grid() const noexcept = 0;
  [[nodiscard]] virtual VoxelBits occupied() const noexcept = 0;
  /// Observed at least once, as free or occupied.
  [[nodiscard]] virtual VoxelBits known() const noexcept = 0;
};

}  // namespace sidestep
