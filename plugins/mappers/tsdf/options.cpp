#include "options.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <limits>

namespace sidestep::tsdf {
namespace {

tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what,
                            std::string hint = {}) {
  return fail(ErrorCode::kConfig, parameter + " " + what, "mapper tsdf", std::move(hint));
}

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

double block_count(const TsdfOptions& options) {
  double blocks = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    blocks *= std::ceil(static_cast<double>(options.size_vox[axis]) / kBlockSide_vox);
  }
  return blocks;
}

Result<void> check_grid(const TsdfOptions& options) {
  if (!std::isfinite(options.resolution_m) || options.resolution_m <= 0.0) {
    return wrong("resolution_m", "must be above 0, not " + text(options.resolution_m));
  }
  if (!options.origin_m.allFinite()) return wrong("origin_m", "must be finite");
  for (int axis = 0; axis < 3; ++axis) {
    if (options.size_vox[axis] <= 0) {
      return wrong("size_vox", "must be above 0 along each axis, not " +
                                   std::to_string(options.size_vox[axis]));
    }
  }
  // What is allocated at once; blocks of distances follow what is seen.
  const double bitsets_mib =
      block_count(options) * kBlockSide_vox * kBlockSide_vox * kBlockSide_vox / 4.0 / (1 << 20);
  const double installed_mib = static_cast<double>(sysconf(_SC_PHYS_PAGES)) *
                               static_cast<double>(sysconf(_SC_PAGE_SIZE)) / (1 << 20);
  if (bitsets_mib > installed_mib || block_count(options) > std::numeric_limits<int>::max()) {
    return wrong("size_vox",
                 "asks for two bitsets of together " + text(std::ceil(bitsets_mib)) +
                     " MiB, this machine has " + text(std::floor(installed_mib)) + " MiB",
                 "choose a smaller size_vox or a larger resolution_m");
  }
  return {};
}

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

Result<void> check_measurement(const TsdfOptions& options) {
  if (!(options.min_range_m >= 0.0)) {
    return wrong("min_range_m", "must not be negative, it is " + text(options.min_range_m));
  }
  if (!std::isfinite(options.max_range_m) || !(options.max_range_m > options.min_range_m)) {
    return wrong("max_range_m",
                 "must be finite and above min_range_m, it is " + text(options.max_range_m));
  }
  if (!std::isfinite(options.floor_z_m)) return wrong("floor_z_m", "must be finite");
  if (!std::isfinite(options.floor_clearance_m)) {
    return wrong("floor_clearance_m", "must be finite");
  }
  if (!std::isfinite(options.self_filter_margin_m) || options.self_filter_margin_m < 0.0) {
    return wrong("self_filter_margin_m",
                 "must not be negative, it is " + text(options.self_filter_margin_m));
  }
  return {};
}

}  // namespace

Fields<TsdfOptions> TsdfOptions::fields() {
  using O = TsdfOptions;
  return Fields<O>()
      .add("resolution_m", &O::resolution_m, "Edge of a voxel.", {.unit = "m", .min = 1e-4})
      .add("size_vox", &O::size_vox, "Voxels along x, y and z.", {.unit = "vox", .min = 1})
      .add("origin_m", &O::origin_m, "Lower corner of the grid in the world.", {.unit = "m"})
      .add("integrator", &O::integrator,
           "simple: a ray for each point; merged: one for all points of a voxel; fast: rays that "
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
           "Whether rays start at the camera; otherwise a truncation distance before the surface.")
      .add("min_range_m", &O::min_range_m, "Nearer points count as no measurement.",
           {.unit = "m", .min = 0.0})
      .add("max_range_m", &O::max_range_m, "Farther points are not inserted; rays end here.",
           {.unit = "m", .min = 0.0})
      .add("floor_z_m", &O::floor_z_m, "Height of the floor in the world.", {.unit = "m"})
      .add("floor_clearance_m", &O::floor_clearance_m,
           "Points lower than this above the floor clear along their ray and are not inserted.",
           {.unit = "m"})
      .add("clear_no_return", &O::clear_no_return,
           "Whether a pixel without return (depth 0) clears up to max_range_m.")
      .add("self_filter_margin_m", &O::self_filter_margin_m,
           "Points this near to the robot's spheres are its own and are dropped.",
           {.unit = "m", .min = 0.0})
      .add("start_cells_per_voxel", &O::start_cells_per_voxel,
           "fast: one ray for each cell that holds points, this many cells along a voxel's edge.",
           {.min = 1, .max = 4})
      .add("max_consecutive_collisions", &O::max_consecutive_collisions,
           "fast: a ray stops after more than this many voxels in a row that others have seen.",
           {.min = 0});
}

Result<void> check_options(const TsdfOptions& options) {
  if (auto ok = check_grid(options); !ok) return ok;
  if (auto ok = check_integration(options); !ok) return ok;
  return check_measurement(options);
}

}  // namespace sidestep::tsdf
