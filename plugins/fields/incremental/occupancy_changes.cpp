#include "occupancy_changes.hpp"

#include <algorithm>
#include <bit>

namespace sidestep::incremental {
namespace {

constexpr int kSide = kBlockSide_vox;
constexpr int kWordBits = 64;

}  // namespace

OccupancyChanges::OccupancyChanges(const OccupancyView& view, bool unknown_is_obstacle)
    : view_(view),
      unknown_is_obstacle_(unknown_is_obstacle),
      obstacles_(view.occupied().words.size(), unknown_is_obstacle ? ~std::uint64_t{0} : 0) {}

void OccupancyChanges::find(std::span<const std::uint8_t> block_changed) {
  inserted_.clear();
  removed_.clear();
  const Eigen::Vector3i counts = block_counts(view_.occupancy_grid());
  for (int b = 0; b < static_cast<int>(block_changed.size()); ++b) {
    if (block_changed[static_cast<std::size_t>(b)] == 0) continue;
    compare_block({b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y())});
  }
}

void OccupancyChanges::compare_block(const Eigen::Vector3i& block) {
  const Eigen::Vector3i& size = view_.occupancy_grid().size_vox;
  const VoxelBits occupied = view_.occupied();
  const VoxelBits known = view_.known();
  const Eigen::Vector3i low = block * kSide;
  const Eigen::Vector3i high = (low.array() + kSide).min(size.array());
  const auto shift = static_cast<unsigned>(low.x() % kWordBits);
  const std::uint64_t in_row = (std::uint64_t{1} << (high.x() - low.x())) - 1;
  for (int z = low.z(); z < high.z(); ++z) {
    for (int y = low.y(); y < high.y(); ++y) {
      const auto row = static_cast<std::size_t>(y) +
                       static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(z);
      const std::size_t at = row * static_cast<std::size_t>(occupied.words_per_row) +
                             static_cast<std::size_t>(low.x() / kWordBits);
      std::uint64_t now = occupied.words[at];
      if (unknown_is_obstacle_) now |= ~known.words[at];
      const std::uint64_t flipped = (now ^ obstacles_[at]) & in_row << shift;
      obstacles_[at] ^= flipped;
      for (std::uint64_t left = flipped >> shift; left != 0; left &= left - 1) {
        const int x = low.x() + std::countr_zero(left);
        const bool is_obstacle = (now >> (x % kWordBits) & 1u) != 0;
        (is_obstacle ? inserted_ : removed_).emplace_back(x, y, z);
      }
    }
  }
}

}  // namespace sidestep::incremental
