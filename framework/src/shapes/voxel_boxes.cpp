#include "voxel_boxes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace sidestep {
namespace {

/// Voxels from `low` to `high`, both included.
struct Block {
  std::array<std::int64_t, 3> low;
  std::array<std::int64_t, 3> high;
};

/// Joins blocks that continue each other along `axis` and agree in the two other axes.
std::vector<Block> join(std::vector<Block> blocks, std::size_t axis) {
  const std::size_t u = (axis + 1) % 3;
  const std::size_t v = (axis + 2) % 3;
  const auto key = [=](const Block& b) {
    return std::array{b.low[u], b.high[u], b.low[v], b.high[v], b.low[axis]};
  };
  std::sort(blocks.begin(), blocks.end(),
            [&](const Block& a, const Block& b) { return key(a) < key(b); });
  std::vector<Block> joined;
  for (const Block& block : blocks) {
    if (!joined.empty()) {
      Block& last = joined.back();
      const bool is_aligned = last.low[u] == block.low[u] && last.high[u] == block.high[u] &&
                              last.low[v] == block.low[v] && last.high[v] == block.high[v];
      if (is_aligned && block.low[axis] <= last.high[axis] + 1) {
        last.high[axis] = std::max(last.high[axis], block.high[axis]);
        continue;
      }
    }
    joined.push_back(block);
  }
  return joined;
}

}  // namespace

std::vector<Eigen::AlignedBox3d> merge_voxels(const std::vector<Eigen::Vector3d>& centres_m,
                                              double resolution_m) {
  if (centres_m.empty()) return {};
  Eigen::Vector3d first = centres_m.front();
  for (const Eigen::Vector3d& centre : centres_m) first = first.cwiseMin(centre);
  std::vector<Block> blocks;
  blocks.reserve(centres_m.size());
  for (const Eigen::Vector3d& centre : centres_m) {
    const Eigen::Vector3d place = (centre - first) / resolution_m;
    const std::array<std::int64_t, 3> voxel{std::llround(place.x()), std::llround(place.y()),
                                            std::llround(place.z())};
    blocks.push_back({voxel, voxel});
  }
  for (const std::size_t axis : {0u, 1u, 2u}) blocks = join(std::move(blocks), axis);
  std::vector<Eigen::AlignedBox3d> boxes;
  boxes.reserve(blocks.size());
  for (const Block& block : blocks) {
    Eigen::AlignedBox3d box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = axis;
      box.min()[i] = first[i] + (static_cast<double>(block.low[axis]) - 0.5) * resolution_m;
      box.max()[i] = first[i] + (static_cast<double>(block.high[axis]) + 0.5) * resolution_m;
    }
    boxes.push_back(box);
  }
  return boxes;
}

}  // namespace sidestep
