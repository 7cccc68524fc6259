#pragma once

#include <sidestep/core/error.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::octomap_mapper {

/// The sensor model's defaults are OctoMap's own (Hornung 2013, Sec. 3.2).
struct OctomapOptions {
  double resolution_m = 0.05;
  Eigen::Vector3i size_vox{160, 160, 64};
  Eigen::Vector3d origin_m{-4.0, -4.0, 0.0};
  double prob_hit = 0.7;
  double prob_miss = 0.4;
  double clamp_min = 0.1192;
  double clamp_max = 0.971;
  double occupied_at = 0.5;
  double min_range_m = 0.0;
  double max_range_m = 5.0;
  double floor_z_m = 0.0;
  double floor_clearance_m = 0.03;
  bool clear_no_return = false;
  double self_filter_margin_m = 0.03;

  static Fields<OctomapOptions> fields();

  [[nodiscard]] GridSpec grid() const { return {origin_m, resolution_m, size_vox}; }
  [[nodiscard]] PointRules rules() const {
    return {min_range_m, max_range_m, floor_z_m, floor_clearance_m};
  }
};

/// Fails with kConfig, naming the parameter, where the values do not make a map.
[[nodiscard]] Result<void> check_options(const OctomapOptions& options);

}  // namespace sidestep::octomap_mapper
