#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

#include <sidestep/mapping/mapper.hpp>

#include "conformance/test_host.hpp"
#include "support/box_world.hpp"

namespace sidestep::testing_support {

/// 4.8 x 4.8 x 2.4 m at 5 cm from (0, -2.4, -0.4) on, so that the floor lies between two layers.
template <class Options>
[[nodiscard]] Options small_map_options() {
  Options options;
  options.resolution_m = 0.05;
  options.size_vox = {96, 96, 48};
  options.origin_m = {0.0, -2.4, -0.4};
  return options;
}

/// Across the whole view, its near face at x.
[[nodiscard]] inline BoxWorld::Box wall_at(double x_m) {
  return {{x_m, -9, -9}, {x_m + 0.2, 9, 9}};
}

/// Looks along +x from 1 m above the floor.
[[nodiscard]] inline Transform eye() { return look_at({0.52, 0.02, 1.02}, {9.0, 0.02, 1.02}); }

/// A mapper made of its options, what it is shown, and what it says of single voxels.
template <class MapperType>
class MapperProbe {
 public:
  /// Throws where the options are wrong.
  template <class Options>
  explicit MapperProbe(const Options& options, int threads = 2,
                       std::shared_ptr<const RobotModel> robot = nullptr)
      : host_(std::make_unique<conformance::TestHost>(
            threads, conformance::TestHostParts{.robot = std::move(robot)})) {
    if (!options.check().empty()) throw std::invalid_argument(options.check()[0].what);
    mapper_ = std::make_unique<MapperType>(options, host_->context());
  }

  MapUpdate integrate(const Frame& frame) {
    auto update = mapper_->integrate(frame);
    if (!update) {
      ADD_FAILURE() << update.error().describe();
      return {};
    }
    return *update;
  }
  /// Integrates the next frame of 160 x 120 pixels, of this world.
  MapUpdate see(const BoxWorld& world, const Transform& T_world_camera = eye()) {
    return integrate(world.frame(sequence_++, kinect(160, 120), T_world_camera));
  }

  [[nodiscard]] Eigen::Vector3i voxel_at(double x_m, double y_m, double z_m) const {
    return grid().voxel_at({x_m, y_m, z_m});
  }
  /// '#' occupied, '.' free, '?' unknown.
  [[nodiscard]] char at(double x_m, double y_m, double z_m) const {
    const Eigen::Vector3i voxel = voxel_at(x_m, y_m, z_m);
    if (mapper_->occupied().at(grid(), voxel)) return '#';
    return mapper_->known().at(grid(), voxel) ? '.' : '?';
  }
  [[nodiscard]] MapperType& mapper() noexcept { return *mapper_; }
  [[nodiscard]] const MapperType& mapper() const noexcept { return *mapper_; }
  [[nodiscard]] const GridSpec& grid() const noexcept { return mapper_->grid(); }

 private:
  std::unique_ptr<conformance::TestHost> host_;
  std::unique_ptr<MapperType> mapper_;
  std::int64_t sequence_ = 0;
};

}  // namespace sidestep::testing_support
