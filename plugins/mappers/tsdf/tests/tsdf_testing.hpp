#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "support/mapper_probe.hpp"
#include "tsdf_mapper.hpp"

namespace sidestep::tsdf {

/// A probe that also tells what the view of the TSDF says.
class TsdfProbe : public testing_support::MapperProbe<TsdfMapper> {
 public:
  using MapperProbe::MapperProbe;

  [[nodiscard]] float distance_m(const Eigen::Vector3i& voxel) const {
    const TsdfBlock* block = block_of(voxel);
    return block == nullptr ? NAN : block->distance_m[index(voxel)];
  }
  [[nodiscard]] float weight(const Eigen::Vector3i& voxel) const {
    const TsdfBlock* block = block_of(voxel);
    return block == nullptr ? 0.0F : block->weight[index(voxel)];
  }
  /// All blocks of distances and weights, empty where there is none.
  [[nodiscard]] std::vector<std::vector<float>> copy() const {
    std::vector<std::vector<float>> all(static_cast<std::size_t>(block_counts(grid()).prod()));
    for (std::size_t b = 0; b < all.size(); ++b) {
      const TsdfBlock* block = mapper().tsdf_block(static_cast<std::int32_t>(b));
      if (block == nullptr) continue;
      all[b].assign(block->distance_m.begin(), block->distance_m.end());
      all[b].insert(all[b].end(), block->weight.begin(), block->weight.end());
    }
    return all;
  }

 private:
  [[nodiscard]] const TsdfBlock* block_of(const Eigen::Vector3i& voxel) const {
    return mapper().tsdf_block(
        block_linear((voxel.array() / kBlockSide_vox).matrix(), block_counts(grid())));
  }
  [[nodiscard]] static std::size_t index(const Eigen::Vector3i& voxel) {
    const Eigen::Vector3i in = voxel.unaryExpr([](int v) { return v % kBlockSide_vox; });
    return static_cast<std::size_t>(in.x() + 16 * (in.y() + 16 * in.z()));
  }
};

using testing_support::eye;
using testing_support::wall_at;

[[nodiscard]] inline TsdfOptions options_of(const std::string& integrator) {
  auto options = testing_support::small_map_options<TsdfOptions>();
  options.integrator = integrator;
  return options;
}

}  // namespace sidestep::tsdf
