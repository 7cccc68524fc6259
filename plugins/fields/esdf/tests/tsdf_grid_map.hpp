#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <vector>

#include <sidestep/mapping/tsdf_view.hpp>
#include "conformance/grid_map.hpp"

namespace sidestep::conformance {

/// A GridMap that offers the TSDF which an ideal sensor would have made of the same voxels: exact
/// distances from centre to centre, positive to the nearest obstacle, negative to the nearest
/// voxel that is none, cut off at four voxels, by search. Voxels never observed have none.
class TsdfGridMap final : public GridMap, public TsdfView {
 public:
  static constexpr int kTruncation_vox = 4;

  TsdfGridMap(const GridSpec& grid, bool unknown_is_occupied)
      : GridMap(grid),
        unknown_is_occupied_(unknown_is_occupied),
        blocks_(static_cast<std::size_t>(block_counts(grid).prod())) {}

  MapUpdate take_update() override {
    rebuild();
    return GridMap::take_update();
  }

  [[nodiscard]] const GridSpec& tsdf_grid() const noexcept override { return grid(); }
  [[nodiscard]] double truncation_m() const noexcept override {
    return kTruncation_vox * grid().resolution_m;
  }
  [[nodiscard]] const TsdfBlock* tsdf_block(std::int32_t block) const noexcept override {
    return blocks_[static_cast<std::size_t>(block)].get();
  }
  [[nodiscard]] std::span<const std::int32_t> tsdf_changed_blocks() const noexcept override {
    return changed_;
  }

 private:
  void rebuild() {
    const Eigen::Vector3i& size = grid().size_vox;
    const auto count = static_cast<std::size_t>(size.prod());
    std::vector<bool> obstacle(count);
    each_voxel([&](const Eigen::Vector3i& v) {
      obstacle[grid().linear(v)] =
          occupied().at(grid(), v) || (unknown_is_occupied_ && !known().at(grid(), v));
    });
    std::vector<int> nearest2(count, kTruncation_vox * kTruncation_vox);
    each_voxel([&](const Eigen::Vector3i& v) { spread(v, obstacle, nearest2); });
    std::vector<std::unique_ptr<TsdfBlock>> blocks(blocks_.size());
    each_voxel([&](const Eigen::Vector3i& v) {
      if (!known().at(grid(), v)) return;
      auto& block = blocks[static_cast<std::size_t>(
          block_linear((v.array() / kBlockSide_vox).matrix(), block_counts(grid())))];
      if (!block) block = std::make_unique<TsdfBlock>();
      const std::size_t linear = grid().linear(v);
      const Eigen::Vector3i in = v.unaryExpr([](int c) { return c % kBlockSide_vox; });
      const auto at = static_cast<std::size_t>(in.x() + 16 * (in.y() + 16 * in.z()));
      const double distance_m =
          std::sqrt(static_cast<double>(nearest2[linear])) * grid().resolution_m;
      block->distance_m[at] = static_cast<float>(obstacle[linear] ? -distance_m : distance_m);
      block->weight[at] = 1.0F;
    });
    changed_.clear();
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      if (!blocks[b]) continue;
      if (blocks_[b] && blocks_[b]->distance_m == blocks[b]->distance_m &&
          blocks_[b]->weight == blocks[b]->weight) {
        continue;
      }
      changed_.push_back(static_cast<std::int32_t>(b));
      blocks_[b] = std::move(blocks[b]);
    }
  }

  /// Tells all voxels of the other kind around a voxel at the border of its kind how near it is.
  void spread(const Eigen::Vector3i& v, const std::vector<bool>& obstacle,
              std::vector<int>& nearest2) const {
    const bool kind = obstacle[grid().linear(v)];
    if (!has_other_kind(v, kind, obstacle)) return;
    const Eigen::Vector3i low = (v.array() - kTruncation_vox).max(0).matrix();
    const Eigen::Vector3i high =
        (v.array() + kTruncation_vox).min(grid().size_vox.array() - 1).matrix();
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const std::size_t to = grid().linear({x, y, z});
          if (obstacle[to] == kind) continue;
          nearest2[to] = std::min(nearest2[to], (Eigen::Vector3i(x, y, z) - v).squaredNorm());
        }
      }
    }
  }

  [[nodiscard]] bool has_other_kind(const Eigen::Vector3i& v, bool kind,
                                    const std::vector<bool>& obstacle) const {
    for (int n = 0; n < 27; ++n) {
      const Eigen::Vector3i other = v + Eigen::Vector3i(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
      if (grid().contains(other) && obstacle[grid().linear(other)] != kind) return true;
    }
    return false;
  }

  template <class Visit>
  void each_voxel(const Visit& visit) const {
    const Eigen::Vector3i& size = grid().size_vox;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) visit(Eigen::Vector3i(x, y, z));
      }
    }
  }

  bool unknown_is_occupied_;
  std::vector<std::unique_ptr<TsdfBlock>> blocks_;
  std::vector<std::int32_t> changed_;
};

}  // namespace sidestep::conformance
