#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "support/box_world.hpp"
#include "support/test_host.hpp"
#include "tsdf_mapper.hpp"

namespace sidestep::tsdf {

/// A mapper, and what its view says of single voxels.
class TsdfProbe {
 public:
  explicit TsdfProbe(const TsdfOptions& options, int threads = 2,
                     std::shared_ptr<const RobotModel> robot = nullptr)
      : host_(std::make_unique<testing_support::TestHost>(threads, std::move(robot))),
        mapper_(std::make_unique<TsdfMapper>(options, host_->context())) {}

  MapUpdate integrate(const Frame& frame) {
    auto update = mapper_->integrate(frame);
    if (!update) {
      ADD_FAILURE() << update.error().describe();
      return {};
    }
    return *update;
  }

  [[nodiscard]] float distance_m(const Eigen::Vector3i& voxel) const {
    const TsdfBlock* block = block_of(voxel);
    return block == nullptr ? NAN : block->distance_m[index(voxel)];
  }
  [[nodiscard]] float weight(const Eigen::Vector3i& voxel) const {
    const TsdfBlock* block = block_of(voxel);
    return block == nullptr ? 0.0F : block->weight[index(voxel)];
  }
  [[nodiscard]] Eigen::Vector3i voxel_at(double x_m, double y_m, double z_m) const {
    return mapper_->grid().voxel_at({x_m, y_m, z_m});
  }
  [[nodiscard]] char at(double x_m, double y_m, double z_m) const {
    const Eigen::Vector3i voxel = voxel_at(x_m, y_m, z_m);
    if (mapper_->occupied().at(mapper_->grid(), voxel)) return '#';
    return mapper_->known().at(mapper_->grid(), voxel) ? '.' : '?';
  }
  /// All blocks of distances and weights, empty where there is none.
  [[nodiscard]] std::vector<std::vector<float>> copy() const {
    std::vector<std::vector<float>> all(
        static_cast<std::size_t>(block_counts(mapper_->grid()).prod()));
    for (std::size_t b = 0; b < all.size(); ++b) {
      const TsdfBlock* block = mapper_->tsdf_block(static_cast<std::int32_t>(b));
      if (block == nullptr) continue;
      all[b].assign(block->distance_m.begin(), block->distance_m.end());
      all[b].insert(all[b].end(), block->weight.begin(), block->weight.end());
    }
    return all;
  }
  [[nodiscard]] TsdfMapper& mapper() noexcept { return *mapper_; }
  [[nodiscard]] const GridSpec& grid() const noexcept { return mapper_->grid(); }

 private:
  [[nodiscard]] const TsdfBlock* block_of(const Eigen::Vector3i& voxel) const {
    return mapper_->tsdf_block(
        block_linear((voxel.array() / kBlockSide_vox).matrix(), block_counts(grid())));
  }
  [[nodiscard]] static std::size_t index(const Eigen::Vector3i& voxel) {
    const Eigen::Vector3i in = voxel.unaryExpr([](int v) { return v % kBlockSide_vox; });
    return static_cast<std::size_t>(in.x() + 16 * (in.y() + 16 * in.z()));
  }

  std::unique_ptr<testing_support::TestHost> host_;
  std::unique_ptr<TsdfMapper> mapper_;
};

/// 4.8 x 4.8 x 2.4 m from (0, -2.4, -0.4) on, so that the floor lies between two layers.
[[nodiscard]] inline TsdfOptions options_of(const std::string& integrator) {
  TsdfOptions options;
  options.resolution_m = 0.05;
  options.size_vox = {96, 96, 48};
  options.origin_m = {0.0, -2.4, -0.4};
  options.integrator = integrator;
  return options;
}

[[nodiscard]] inline testing_support::BoxWorld::Box wall_at(double x_m) {
  return {{x_m, -9, -9}, {x_m + 0.2, 9, 9}};
}

/// Looks along +x from 1 m above the floor.
[[nodiscard]] inline Transform eye() {
  return testing_support::look_at({0.52, 0.02, 1.02}, {9.0, 0.02, 1.02});
}

}  // namespace sidestep::tsdf
