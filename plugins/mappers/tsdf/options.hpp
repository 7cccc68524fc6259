#pragma once

#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::tsdf {

struct TsdfOptions {
  double resolution_m = 0.025;
  Eigen::Vector3i size_vox{320, 320, 128};
  Eigen::Vector3d origin_m{-4.0, -4.0, 0.0};
  std::string integrator = "fast";
  double truncation_vox = 4.0;
  std::string weighting = "inverse_square";
  bool weight_dropoff = true;
  double max_weight = 10000.0;
  bool carving = true;
  double min_range_m = 0.0;
  double max_range_m = 5.0;
  double floor_z_m = 0.0;
  double floor_clearance_m = 0.03;
  bool clear_no_return = false;
  double self_filter_margin_m = 0.03;
  int start_cells_per_voxel = 2;
  int max_consecutive_collisions = 2;

  static Fields<TsdfOptions> fields();

  [[nodiscard]] GridSpec grid() const { return {origin_m, resolution_m, size_vox}; }
  [[nodiscard]] PointRules rules() const {
    return {min_range_m, max_range_m, floor_z_m, floor_clearance_m};
  }
};

/// Fails with kConfig, naming the parameter, where the values do not make a map.
[[nodiscard]] Result<void> check_options(const TsdfOptions& options);

}  // namespace sidestep::tsdf
