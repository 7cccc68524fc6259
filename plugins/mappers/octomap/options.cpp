#include "options.hpp"

#include <cmath>
#include <cstdio>

namespace sidestep::octomap_mapper {
namespace {

/// OctoMap's keys are 16 bits, with the world's origin in the middle.
constexpr double kKeysEachWay = 32768.0;
constexpr double kAlignment_vox = 1e-4;
/// One bit each for occupied and known; more than this is a slip of the pen.
constexpr double kLargestGrid_vox = 16.0 * 1024 * 1024 * 1024;

std::string text(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%g", value);
  return buffer;
}

tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what,
                            std::string hint = {}) {
  return fail(ErrorCode::kConfig, parameter + " " + what, "mapper octomap", std::move(hint));
}

Result<void> check_grid(const OctomapOptions& options) {
  if (!std::isfinite(options.resolution_m) || options.resolution_m <= 0.0) {
    return wrong("resolution_m", "must be above 0, not " + text(options.resolution_m));
  }
  if (!options.origin_m.allFinite()) return wrong("origin_m", "must be finite");
  double voxels = 1.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int size = options.size_vox[axis];
    if (size <= 0) {
      return wrong("size_vox", "must be above 0 along each axis, not " + std::to_string(size));
    }
    voxels *= size;
    const double first = options.origin_m[axis] / options.resolution_m;
    if (std::abs(first - std::round(first)) > kAlignment_vox) {
      return wrong("origin_m",
                   "must be a multiple of resolution_m along each axis, as OctoMap's voxels are; " +
                       text(options.origin_m[axis]) + " is not",
                   "use " + text(std::round(first) * options.resolution_m));
    }
    if (first < -kKeysEachWay || first + size > kKeysEachWay) {
      return wrong("size_vox",
                   "and origin_m reach beyond 32768 voxels from the world's origin, "
                   "where OctoMap ends");
    }
  }
  if (voxels > kLargestGrid_vox) {
    return wrong("size_vox",
                 "asks for two bitsets of " + text(std::ceil(voxels / 8 / (1 << 20))) +
                     " MiB each, more than the 2048 MiB allowed",
                 "choose a smaller size_vox or a larger resolution_m");
  }
  return {};
}

Result<void> check_model(const OctomapOptions& options) {
  if (!(options.prob_hit > 0.5 && options.prob_hit < 1.0)) {
    return wrong("prob_hit", "must be above 0.5 and below 1, not " + text(options.prob_hit));
  }
  if (!(options.prob_miss > 0.0 && options.prob_miss < 0.5)) {
    return wrong("prob_miss", "must be above 0 and below 0.5, not " + text(options.prob_miss));
  }
  if (!(options.clamp_min > 0.0 && options.clamp_max < 1.0)) {
    return wrong("clamp_min", "and clamp_max must lie between 0 and 1, not " +
                                  text(options.clamp_min) + " and " + text(options.clamp_max));
  }
  if (!(options.clamp_min < options.clamp_max)) {
    return wrong("clamp_min", "must be below clamp_max, but " + text(options.clamp_min) +
                                  " >= " + text(options.clamp_max));
  }
  if (!(options.occupied_at > options.clamp_min && options.occupied_at <= options.clamp_max)) {
    return wrong("occupied_at",
                 "must be above clamp_min and at most clamp_max, or no voxel ever changes; " +
                     text(options.occupied_at) + " is not");
  }
  return {};
}

Result<void> check_measurement(const OctomapOptions& options) {
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

Fields<OctomapOptions> OctomapOptions::fields() {
  using O = OctomapOptions;
  return Fields<O>()
      .add("resolution_m", &O::resolution_m, "Edge of the smallest voxel.",
           {.unit = "m", .min = 1e-4})
      .add("size_vox", &O::size_vox, "Voxels of the bounding box along x, y and z.",
           {.unit = "vox", .min = 1})
      .add("origin_m", &O::origin_m,
           "Lower corner of the bounding box in the world; a multiple of resolution_m.",
           {.unit = "m"})
      .add("prob_hit", &O::prob_hit, "Probability of occupancy given a hit.",
           {.min = 0.5, .max = 1.0})
      .add("prob_miss", &O::prob_miss, "Probability of occupancy given a ray passing through.",
           {.min = 0.0, .max = 0.5})
      .add("clamp_min", &O::clamp_min, "Lower clamp of the probability.", {.min = 0.0, .max = 1.0})
      .add("clamp_max", &O::clamp_max, "Upper clamp of the probability.", {.min = 0.0, .max = 1.0})
      .add("occupied_at", &O::occupied_at, "A voxel is occupied from this probability on.",
           {.min = 0.0, .max = 1.0})
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
           {.unit = "m", .min = 0.0});
}

Result<void> check_options(const OctomapOptions& options) {
  if (auto ok = check_grid(options); !ok) return ok;
  if (auto ok = check_model(options); !ok) return ok;
  return check_measurement(options);
}

}  // namespace sidestep::octomap_mapper
