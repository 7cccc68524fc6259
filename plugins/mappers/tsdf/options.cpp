#include "options.hpp"

namespace sidestep::tsdf {

Parameters<TsdfOptions> TsdfOptions::parameters() {
  using O = TsdfOptions;
  return declare_measurement(std::move(
      declare_grid(Parameters<O>())
          .add("integrator", &O::integrator,
               "simple: a ray for each point; merged: one for all points of a voxel; fast: rays "
               "that "
               "bring little new are left out or cut short.",
               {.choices = {"simple", "merged", "fast"}})
          .add("truncation_vox", &O::truncation_vox,
               "Distances are cut off here; rays reach this far behind the surface.",
               {.unit = "vox", .min = 2.0, .max = 100.0})
          .add("weighting", &O::weighting,
               "Weight of a point: 1, or 1/z^2 with its depth z in metres, as the noise of a depth "
               "camera grows.",
               {.choices = {"constant", "inverse_square"}})
          .add("weight_dropoff", &O::weight_dropoff,
               "Whether weights fall linearly to 0 from one voxel behind the surface to the "
               "truncation distance.")
          .add("max_weight", &O::max_weight,
               "Weights stop growing here; the smaller, the faster the map follows change.",
               {.min = 0.0})
          .add("carving", &O::carving,
               "Whether rays start at the camera; otherwise a truncation distance before the "
               "surface.")
          .add("start_cells_per_voxel", &O::start_cells_per_voxel,
               "fast: one ray for each cell that holds points, this many cells along a voxel's "
               "edge.",
               {.min = 1, .max = 4})
          .add("max_consecutive_collisions", &O::max_consecutive_collisions,
               "fast: a ray stops after more than this many voxels in a row that others have seen.",
               {.min = 0})));
}

std::vector<OptionMistake> TsdfOptions::check() const {
  // What is allocated at once, two bitsets; blocks of distances follow what is seen.
  const double bitsets_mib = voxels_of_blocks(*this) / 4.0 / (1 << 20);
  std::vector<OptionMistake> mistakes = check_map_options(*this, bitsets_mib);
  if (!(max_weight > 0.0)) mistakes.push_back({{"max_weight"}, "must be above 0", {}});
  return mistakes;
}

}  // namespace sidestep::tsdf
