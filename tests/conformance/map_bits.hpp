#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::conformance {

/// Both bitsets of a map at one time.
struct MapBits {
  std::vector<std::uint64_t> occupied;
  std::vector<std::uint64_t> known;
  friend bool operator==(const MapBits&, const MapBits&) = default;
};

[[nodiscard]] inline MapBits copy_bits(const OccupancyView& view) {
  const auto copy = [](VoxelBits bits) {
    return std::vector<std::uint64_t>(bits.words.begin(), bits.words.end());
  };
  return {copy(view.occupied()), copy(view.known())};
}

/// The blocks in which two states of a map differ, by looking at every voxel.
[[nodiscard]] inline std::vector<std::int32_t> differing_blocks(const GridSpec& grid,
                                                                const MapBits& before,
                                                                const MapBits& after) {
  const Eigen::Vector3i counts = block_counts(grid);
  const int words_per_row = (grid.size_vox.x() + 63) / 64;
  std::vector<bool> differs(static_cast<std::size_t>(counts.prod()));
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const Eigen::Vector3i voxel(x, y, z);
        const auto at = [&](const std::vector<std::uint64_t>& words) {
          return VoxelBits{words, words_per_row}.at(grid, voxel);
        };
        if (at(before.occupied) != at(after.occupied) || at(before.known) != at(after.known)) {
          differs[static_cast<std::size_t>(block_linear(voxel / kBlockSide_vox, counts))] = true;
        }
      }
    }
  }
  std::vector<std::int32_t> blocks;
  for (std::size_t b = 0; b < differs.size(); ++b) {
    if (differs[b]) blocks.push_back(static_cast<std::int32_t>(b));
  }
  return blocks;
}

}  // namespace sidestep::conformance
