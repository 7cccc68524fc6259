#include "options.hpp"

#include "log_odds_grid.hpp"

namespace sidestep::voxel_grid {
namespace {

tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what) {
  return wrong_parameter(parameter, what, "voxel_grid");
}

std::string text(double value) { return detail::number_text(value); }

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

Result<void> check_method(const VoxelGridOptions& options) {
  if (!(options.surface_band_vox >= 0.0 && options.surface_band_vox <= 10.0)) {
    return wrong("surface_band_vox", "must be in [0, 10], not " + text(options.surface_band_vox));
  }
  if (options.method != "auto" && options.method != "projective" && options.method != "raycast") {
    return wrong("method", "must be auto, projective or raycast, not '" + options.method + "'");
  }
  if (!(options.fade_half_life_s >= 0.0)) {
    return wrong("fade_half_life_s", "must be at least 0, not " + text(options.fade_half_life_s));
  }
  return {};
}

Result<void> check_window(const VoxelGridOptions& options) {
  if (!options.sliding_window ||
      (options.size_vox.x() % kBlockSide_vox == 0 && options.size_vox.y() % kBlockSide_vox == 0)) {
    return {};
  }
  return wrong("size_vox", "must be a multiple of " + std::to_string(kBlockSide_vox) +
                               " along x and y where sliding_window is on");
}

}  // namespace

Fields<VoxelGridOptions> VoxelGridOptions::fields() {
  using O = VoxelGridOptions;
  return declare_measurement(std::move(
      declare_grid(Fields<O>())
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
          .add("surface_band_vox", &O::surface_band_vox,
               "Projective method: half-width of the band around the measured depth that is hit.",
               {.unit = "vox", .min = 0.0, .max = 10.0})
          .add("method", &O::method,
               "How frames are integrated; auto: images projective, clouds raycast.",
               {.choices = {"auto", "projective", "raycast"}})
          .add("sliding_window", &O::sliding_window,
               "Whether the grid moves with the camera along x and y, by blocks of 16 voxels; "
               "origin_m is where it lies in the first frame. What leaves it is forgotten.")
          .add("fade_half_life_s", &O::fade_half_life_s,
               "Time in which the log-odds of what is not seen halve, until it is unknown; 0: "
               "never.",
               {.unit = "s", .min = 0.0})));
}

double memory_mib(const VoxelGridOptions& options) {
  // Log-odds, two bitsets of the map, three of the frame (hits, misses, ends of rays).
  constexpr double kBytesPerVoxel = sizeof(std::int16_t) + 5.0 / 8.0;
  return voxels_of_blocks(options) * kBytesPerVoxel / (1 << 20);
}

Result<void> check_options(const VoxelGridOptions& options) {
  if (auto ok = check_map_options(options, memory_mib(options), "voxel_grid"); !ok) return ok;
  if (auto ok = check_log_odds(options); !ok) return ok;
  if (auto ok = check_window(options); !ok) return ok;
  return check_method(options);
}

}  // namespace sidestep::voxel_grid
