#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::conformance {

/// A map whose voxels are set one by one, for testing fields. Offers an OccupancyView.
class GridMap : public Mapper, public OccupancyView {
 public:
  explicit GridMap(const GridSpec& grid)
      : grid_(grid), words_per_row_((grid.size_vox.x() + 63) / 64) {
    const std::size_t words = static_cast<std::size_t>(words_per_row_) *
                              static_cast<std::size_t>(grid.size_vox.y()) *
                              static_cast<std::size_t>(grid.size_vox.z());
    occupied_.assign(words, 0);
    known_.assign(words, 0);
  }

  /// Observes a voxel.
  virtual void set(const Eigen::Vector3i& voxel, bool occupied) {
    const std::uint64_t bit = std::uint64_t{1} << (voxel.x() % 64);
    const std::size_t word = word_of(voxel);
    occupied_[word] = occupied ? occupied_[word] | bit : occupied_[word] & ~bit;
    known_[word] |= bit;
    changed_.insert(block_linear((voxel.array() / kBlockSide_vox).matrix(), block_counts(grid_)));
  }

  /// What was set since the call before.
  [[nodiscard]] virtual MapUpdate take_update() {
    MapUpdate update;
    update.sequence = ++sequence_;
    update.stamp = Stamp::from_seconds(static_cast<double>(sequence_));
    update.changed_blocks.assign(changed_.begin(), changed_.end());
    changed_.clear();
    return update;
  }

  Result<MapUpdate> integrate(const Frame&) override { return take_update(); }
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

 private:
  [[nodiscard]] std::size_t word_of(const Eigen::Vector3i& voxel) const {
    const std::size_t row =
        static_cast<std::size_t>(voxel.y()) +
        static_cast<std::size_t>(grid_.size_vox.y()) * static_cast<std::size_t>(voxel.z());
    return row * static_cast<std::size_t>(words_per_row_) +
           static_cast<std::size_t>(voxel.x() / 64);
  }

  GridSpec grid_;
  int words_per_row_;
  std::vector<std::uint64_t> occupied_, known_;
  std::set<std::int32_t> changed_;
  std::int64_t sequence_ = 0;
};

}  // namespace sidestep::conformance
