#pragma once

#include <string>
#include <vector>

#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::voxel_grid {

struct VoxelGridOptions : MapOptions {
  double l_hit = 0.85;
  double l_miss = -0.4;
  double l_min = -1.2;
  double l_max = 1.5;
  double occupied_at = 0.0;
  double surface_band_vox = 0.5;
  std::string method = "auto";
  bool sliding_window = false;
  double fade_half_life_s = 0.0;

  static Parameters<VoxelGridOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// Memory that a map with these options takes once all of it has been seen.
[[nodiscard]] double memory_mib(const VoxelGridOptions& options);

}  // namespace sidestep::voxel_grid
