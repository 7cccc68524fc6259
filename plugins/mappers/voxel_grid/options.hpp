#pragma once

#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::voxel_grid {

struct VoxelGridOptions {
  double resolution_m = 0.025;
  Eigen::Vector3i size_vox{320, 320, 128};
  Eigen::Vector3d origin_m{-4.0, -4.0, 0.0};
  double l_hit = 0.85;
  double l_miss = -0.4;
  double l_min = -1.2;
  double l_max = 1.5;
  double occupied_at = 0.0;
  double min_range_m = 0.0;
  double max_range_m = 5.0;
  double floor_z_m = 0.0;
  double floor_clearance_m = 0.03;
  bool clear_no_return = false;
  double self_filter_margin_m = 0.03;
  double surface_band_vox = 0.5;
  std::string method = "auto";

  static Fields<VoxelGridOptions> fields();

  [[nodiscard]] GridSpec grid() const { return {origin_m, resolution_m, size_vox}; }
  [[nodiscard]] PointRules rules() const {
    return {min_range_m, max_range_m, floor_z_m, floor_clearance_m};
  }
};

/// Fails with kConfig, naming the parameter, where the values do not make a map.
[[nodiscard]] Result<void> check_options(const VoxelGridOptions& options);

/// Memory that a map with these options takes once all of it has been seen.
[[nodiscard]] double memory_mib(const VoxelGridOptions& options);

}  // namespace sidestep::voxel_grid
