#pragma once

#include <string>
#include <vector>

#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

namespace sidestep::tsdf {

struct TsdfOptions : MapOptions {
  std::string integrator = "fast";
  double truncation_vox = 4.0;
  std::string weighting = "inverse_square";
  bool weight_dropoff = true;
  double max_weight = 10000.0;
  bool carving = true;
  int start_cells_per_voxel = 2;
  int max_consecutive_collisions = 2;

  static Parameters<TsdfOptions> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

}  // namespace sidestep::tsdf
