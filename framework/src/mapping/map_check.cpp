#include <sidestep/mapping/map_check.hpp>

#include <string>

namespace sidestep {
namespace {

tl::unexpected<Error> breach(std::string message) {
  return fail(ErrorCode::kPlugin, std::move(message));
}

/// Whether one bit a voxel is there.
Result<void> check_bits(const GridSpec& grid, const VoxelBits& bits, const std::string& name) {
  const auto rows =
      static_cast<std::size_t>(grid.size_vox.y()) * static_cast<std::size_t>(grid.size_vox.z());
  if (64 * bits.words_per_row >= grid.size_vox.x() &&
      bits.words.size() == rows * static_cast<std::size_t>(bits.words_per_row)) {
    return {};
  }
  return breach("its " + name + " are " + std::to_string(bits.words.size()) + " words of " +
                std::to_string(bits.words_per_row) + " a row, not those of its grid");
}

}  // namespace

MapCheck::MapCheck(const Mapper& mapper)
    : mapper_(mapper),
      occupancy_(dynamic_cast<const OccupancyView*>(&mapper)),
      grid_(mapper.grid()) {}

Result<void> MapCheck::check(const Frame& frame, const MapUpdate& update) {
  const GridSpec& grid = mapper_.grid();
  if (grid.size_vox != grid_.size_vox || grid.resolution_m != grid_.resolution_m) {
    return breach("its grid has another size or resolution than before");
  }
  if (!update.grid_moved && grid.origin_m != grid_.origin_m) {
    return breach("its grid has moved, and the update does not say so");
  }
  grid_ = grid;
  if (update.stamp != frame.stamp) return breach("the update has another stamp than the frame");
  if (update.sequence <= 0 || (sequence_ > 0 && update.sequence != sequence_ + 1)) {
    return breach("update " + std::to_string(update.sequence) + " follows update " +
                  std::to_string(sequence_));
  }
  sequence_ = update.sequence;
  std::int32_t last = -1;
  for (const std::int32_t block : update.changed_blocks) {
    if (block <= last) return breach("changed blocks do not ascend");
    last = block;
  }
  if (last >= block_counts(grid).prod()) {
    return breach("block " + std::to_string(last) + " is not in its grid");
  }
  if (occupancy_ == nullptr) return {};
  if (!(occupancy_->occupancy_grid() == grid)) {
    return breach("the grid of its occupancy is another");
  }
  SIDESTEP_TRY(check_bits(grid, occupancy_->occupied(), "occupied bits"));
  return check_bits(grid, occupancy_->known(), "known bits");
}

}  // namespace sidestep
