#pragma once

#include <memory>
#include <vector>

#include <sidestep/field/dense_field.hpp>

namespace sidestep {

/// The occupied voxels of a map, kept up to date field by field: those that were seen and whose
/// distance is 0 or less. Not for several threads at once.
class OccupiedVoxels {
 public:
  /// Larger grids are passed over: those of exact fields have voxels of a millimetre.
  static constexpr std::size_t kMostVoxels = std::size_t{1} << 27;

  /// Takes over what `field`, not null, says. Blocks of a dense field that are those of the field
  /// before are not looked at again. Whether anything changed.
  bool update(std::shared_ptr<const DistanceField> field);

  /// The grid they are in; of size 0 where it is passed over.
  [[nodiscard]] const GridSpec& grid() const noexcept { return grid_; }
  /// Their centres, world frame, block by block.
  [[nodiscard]] std::vector<Eigen::Vector3d> centres_m() const;

 private:
  /// Of a block, in its own order of voxels.
  using Voxels = std::vector<std::uint16_t>;

  [[nodiscard]] bool is_same_block(const DistanceField& field, std::size_t block) const noexcept;
  [[nodiscard]] Voxels find(const DistanceField& field, std::size_t block) const;
  [[nodiscard]] Eigen::Vector3i voxel(std::size_t block, int index) const noexcept;

  GridSpec grid_;
  std::vector<Voxels> blocks_;
  std::shared_ptr<const DistanceField> last_;  ///< Keeps its blocks, so that none is taken for it.
};

}  // namespace sidestep
