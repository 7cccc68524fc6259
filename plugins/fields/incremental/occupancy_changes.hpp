#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::incremental {

/// Which voxels became obstacles and which ceased to be, found by comparing the blocks that a map
/// says it changed with a copy of the bits that they had before. [mapping]
class OccupancyChanges {
 public:
  /// Voxels never observed are obstacles if `unknown_is_obstacle`; before the first find() none
  /// has been observed. `view` must outlive this.
  OccupancyChanges(const OccupancyView& view, bool unknown_is_obstacle);

  /// Fills both queues from the flagged blocks, one flag a block in block_linear order. Fills
  /// them in that order, so that what follows does not depend on who changed the map how.
  void find(std::span<const std::uint8_t> block_changed);

  /// What the newest find() found.
  [[nodiscard]] const std::vector<Eigen::Vector3i>& inserted() const noexcept { return inserted_; }
  [[nodiscard]] const std::vector<Eigen::Vector3i>& removed() const noexcept { return removed_; }

 private:
  void compare_block(const Eigen::Vector3i& block);

  const OccupancyView& view_;
  bool unknown_is_obstacle_;
  std::vector<std::uint64_t> obstacles_;  // as VoxelBits
  std::vector<Eigen::Vector3i> inserted_, removed_;
};

}  // namespace sidestep::incremental
