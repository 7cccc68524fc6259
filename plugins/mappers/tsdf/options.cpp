#include "options.hpp"

#include <cmath>

namespace sidestep::tsdf {
namespace {

tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what) {
  return wrong_parameter(parameter, what, "tsdf");
}

std::string text(double value) { return detail::number_text(value); }

Result<void> check_integration(const TsdfOptions& options) {
  if (options.integrator != "simple" && options.integrator != "merged" &&
      options.integrator != "fast") {
    return wrong("integrator", "must be simple, merged or fast, not '" + options.integrator + "'");
  }
  if (options.weighting != "constant" && options.weighting != "inverse_square") {
    return wrong("weighting",
                 "must be constant or inverse_square, not '" + options.weighting + "'");
  }
  if (!(options.truncation_vox >= 2.0 && options.truncation_vox <= 100.0)) {
    return wrong("truncation_vox", "must be in [2, 100], not " + text(options.truncation_vox));
  }
  if (!(options.max_weight > 0.0) || !std::isfinite(options.max_weight)) {
    return wrong("max_weight", "must be finite and above 0, it is " + text(options.max_weight));
  }
  if (options.start_cells_per_voxel < 1 || options.start_cells_per_voxel > 4) {
    return wrong("start_cells_per_voxel",
                 "must be in [1, 4], not " + std::to_string(options.start_cells_per_voxel));
  }
  if (options.max_consecutive_collisions < 0) {
    return wrong(
        "max_consecutive_collisions",
        "must not be negative, it is " + std::to_string(options.max_consecutive_collisions));
  }
  return {};
}

}  // namespace

Fields<TsdfOptions> TsdfOptions::fields() {
  using O = TsdfOptions;
  return declare_measurement(std::move(
      declare_grid(Fields<O>())
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

Result<void> check_options(const TsdfOptions& options) {
  // What is allocated at once, two bitsets; blocks of distances follow what is seen.
  const double bitsets_mib = voxels_of_blocks(options) / 4.0 / (1 << 20);
  if (auto ok = check_map_options(options, bitsets_mib, "tsdf"); !ok) return ok;
  return check_integration(options);
}

}  // namespace sidestep::tsdf
