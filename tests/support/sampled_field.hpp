#pragma once

#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <sidestep/field/dense_field.hpp>

namespace sidestep::testing_support {

/// A dense field, known everywhere, whose value at each voxel's centre is distance(centre), which
/// nowhere changes by more than the way.
template <class Distance>
[[nodiscard]] std::shared_ptr<const DenseField> sampled_field(const GridSpec& grid,
                                                              Distance distance) {
  const Eigen::Vector3i counts = block_counts(grid);
  std::vector<DenseField::Blocks::Entry> blocks;
  for (int b = 0; b < counts.prod(); ++b) {
    const Eigen::Vector3i first =
        kBlockSide_vox *
        Eigen::Vector3i(b % counts.x(), b / counts.x() % counts.y(), b / (counts.x() * counts.y()));
    auto block = std::make_shared<FieldBlock>();
    for (int v = 0; v < FieldBlock::kVoxels; ++v) {
      const Eigen::Vector3i voxel =
          first + Eigen::Vector3i(v % kBlockSide_vox, v / kBlockSide_vox % kBlockSide_vox,
                                  v / (kBlockSide_vox * kBlockSide_vox));
      block->distance_m[static_cast<std::size_t>(v)] =
          static_cast<float>(distance(grid.centre_m(voxel)));
    }
    blocks.push_back(std::move(block));
  }
  const auto all_known = std::make_shared<KnownBlock>();
  all_known->rows.fill(0xffff);
  FieldInfo info;
  info.grid = grid;
  info.is_signed = true;
  info.steepest = 1.0;
  info.max_distance_m = std::numeric_limits<double>::infinity();
  std::vector<DenseField::KnownBlocks::Entry> known(blocks.size(), all_known);
  return std::make_shared<DenseField>(info, std::move(blocks), std::move(known));
}

}  // namespace sidestep::testing_support
