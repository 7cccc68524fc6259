#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/field/dense_field.hpp>

namespace sidestep {

/// Which voxels of a block are occupied, and which are known: bit x of row y + 16 z. Bits beyond
/// the grid are 0.
struct BlockBits {
  using Rows = std::array<std::uint16_t, kBlockSide_vox * kBlockSide_vox>;
  Rows occupied{};
  Rows known{};

  friend bool operator==(const BlockBits&, const BlockBits&) = default;
};

/// A map as a viewer draws it, kept up to date field by field. A voxel is occupied where its
/// distance is 0 or less.
class SIDESTEP_EXPORT OccupancyBits {
 public:
  /// Larger grids are not drawn: those of exact fields have voxels of a millimetre.
  static constexpr std::size_t kMostVoxels = std::size_t{1} << 27;

  struct Change {
    bool is_new_grid = false;          ///< Nothing of before holds any more.
    std::vector<std::int32_t> blocks;  ///< Whose bits are others now, ascending.

    [[nodiscard]] bool any() const noexcept { return is_new_grid || !blocks.empty(); }
  };
  /// Takes over what `field`, not null, says. Blocks that it shares with the field before are not
  /// looked at. Of a grid that is too large: an empty grid.
  Change update(std::shared_ptr<const DistanceField> field);

  /// Forgets everything.
  void clear();

  /// Whether there is nothing to draw.
  [[nodiscard]] bool is_empty() const noexcept { return blocks_.empty(); }
  [[nodiscard]] const GridSpec& grid() const noexcept { return grid_; }
  [[nodiscard]] const BlockBits& block(std::int32_t index) const noexcept {
    return blocks_[static_cast<std::size_t>(index)];
  }
  /// The blocks with any bit set, ascending.
  [[nodiscard]] std::vector<std::int32_t> filled() const;
  /// Centres of the voxels that are known to be occupied, world frame, block by block.
  [[nodiscard]] std::vector<Eigen::Vector3d> occupied_centres_m() const;

 private:
  void start(const GridSpec& grid);

  GridSpec grid_;
  std::vector<BlockBits> blocks_;
  std::shared_ptr<const DistanceField> last_;  ///< Keeps its blocks, so that none is taken for it.
};

}  // namespace sidestep
