#include "options.hpp"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "log_odds_grid.hpp"

namespace sidestep::voxel_grid {
namespace {

tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what,
                            std::string hint = {}) {
  return fail(ErrorCode::kConfig, parameter + " " + what, "mapper voxel_grid", std::move(hint));
}

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

double block_count(const VoxelGridOptions& options) {
  double blocks = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    blocks *= std::ceil(static_cast<double>(options.size_vox[axis]) / kBlockSide_vox);
  }
  return blocks;
}

Result<void> check_grid(const VoxelGridOptions& options) {
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
  const double installed_mib = static_cast<double>(sysconf(_SC_PHYS_PAGES)) *
                               static_cast<double>(sysconf(_SC_PAGE_SIZE)) / (1 << 20);
  const double needed_mib = memory_mib(options);
  if (needed_mib > installed_mib || block_count(options) > std::numeric_limits<int>::max()) {
    return wrong("size_vox",
                 "asks for a map of " + text(std::ceil(needed_mib)) + " MiB, this machine has " +
                     text(std::floor(installed_mib)) + " MiB",
                 "choose a smaller size_vox or a larger resolution_m");
  }
  return {};
}

Result<void> check_log_odds(const VoxelGridOptions& options) {
  const double limit = LogOdds::kLargest;
  const double step = 1.0 / LogOdds::kUnits;
  if (!(options.l_hit >= step && options.l_hit <= limit)) {
    return wrong("l_hit", "must be in [" + text(step) + ", " + text(limit) + "], not " +
                              text(options.l_hit));
  }
  if (!(options.l_miss <= -step && options.l_miss >= -limit)) {
    return wrong("l_miss", "must be in [" + text(-limit) + ", " + text(-step) + "], not " +
                               text(options.l_miss));
  }
  if (!(options.l_min < options.l_max)) {
    return wrong("l_min",
                 "must be below l_max, but " + text(options.l_min) + " >= " + text(options.l_max));
  }
  if (!(options.l_min <= -step && options.l_min >= -limit)) {
    return wrong("l_min", "must be in [" + text(-limit) + ", " + text(-step) + "], not " +
                              text(options.l_min));
  }
  if (!(options.l_max >= step && options.l_max <= limit)) {
    return wrong("l_max", "must be in [" + text(step) + ", " + text(limit) + "], not " +
                              text(options.l_max));
  }
  if (!(options.occupied_at > options.l_min && options.occupied_at <= options.l_max)) {
    return wrong("occupied_at",
                 "must be above l_min and at most l_max, or no voxel ever changes; " +
                     text(options.occupied_at) + " is not");
  }
  return {};
}

Result<void> check_measurement(const VoxelGridOptions& options) {
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
  if (!(options.surface_band_vox >= 0.0 && options.surface_band_vox <= 10.0)) {
    return wrong("surface_band_vox", "must be in [0, 10], not " + text(options.surface_band_vox));
  }
  if (options.method != "auto" && options.method != "projective" && options.method != "raycast") {
    return wrong("method", "must be auto, projective or raycast, not '" + options.method + "'");
  }
  return {};
}

}  // namespace

Fields<VoxelGridOptions> VoxelGridOptions::fields() {
  using O = VoxelGridOptions;
  return Fields<O>()
      .add("resolution_m", &O::resolution_m, "Edge of a voxel.", {.unit = "m", .min = 1e-4})
      .add("size_vox", &O::size_vox, "Voxels along x, y and z.", {.unit = "vox", .min = 1})
      .add("origin_m", &O::origin_m, "Lower corner of the grid in the world.", {.unit = "m"})
      .add("l_hit", &O::l_hit, "Log-odds that a hit adds, in steps of 0.001.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("l_miss", &O::l_miss, "Log-odds that a ray passing through adds; negative.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_min", &O::l_min, "Lower clamp: with l_hit, frames until a new obstacle appears.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_max", &O::l_max, "Upper clamp: with l_miss, frames until a removed one is gone.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("occupied_at", &O::occupied_at, "A voxel is occupied from these log-odds on.",
           {.min = -LogOdds::kLargest, .max = LogOdds::kLargest})
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
      .add("surface_band_vox", &O::surface_band_vox,
           "Projective method: half-width of the band around the measured depth that is hit.",
           {.unit = "vox", .min = 0.0, .max = 10.0})
      .add("method", &O::method,
           "How frames are integrated; auto: images projective, clouds raycast.",
           {.choices = {"auto", "projective", "raycast"}});
}

double memory_mib(const VoxelGridOptions& options) {
  // Log-odds, two bitsets of the map, three of the frame (hits, misses, ends of rays).
  constexpr double kBytesPerVoxel = sizeof(std::int16_t) + 5.0 / 8.0;
  const double voxels = block_count(options) * kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  return voxels * kBytesPerVoxel / (1 << 20);
}

Result<void> check_options(const VoxelGridOptions& options) {
  if (auto ok = check_grid(options); !ok) return ok;
  if (auto ok = check_log_odds(options); !ok) return ok;
  return check_measurement(options);
}

}  // namespace sidestep::voxel_grid
