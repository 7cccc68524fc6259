#pragma once

#include <string>
#include <utility>
#include <vector>

#include <sidestep/plugin/map_options.hpp>
#include <sidestep/plugin/plugin.hpp>

#include "log_odds_grid.hpp"

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

/// Adds the inverse sensor model and the method. `O` is VoxelGridOptions or derives from it.
template <class O>
[[nodiscard]] Parameters<O> declare_sensor_model(Parameters<O> parameters) {
  using V = VoxelGridOptions;
  return std::move(parameters)
      .add("l_hit", &V::l_hit, "Log-odds that a hit adds, in steps of 0.001.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("l_miss", &V::l_miss, "Log-odds that a ray passing through adds; negative.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_min", &V::l_min, "Lower clamp: with l_hit, frames until a new obstacle appears.",
           {.min = -LogOdds::kLargest, .max = -0.001})
      .add("l_max", &V::l_max, "Upper clamp: with l_miss, frames until a removed one is gone.",
           {.min = 0.001, .max = LogOdds::kLargest})
      .add("occupied_at", &V::occupied_at, "A voxel is occupied from these log-odds on.",
           {.min = -LogOdds::kLargest, .max = LogOdds::kLargest})
      .add("surface_band_vox", &V::surface_band_vox,
           "Projective method: half-width of the band around the measured depth that is hit.",
           {.unit = "vox", .min = 0.0, .max = 10.0})
      .add("method", &V::method,
           "How frames are integrated; auto: images projective, clouds raycast.",
           {.choices = {"auto", "projective", "raycast"}});
}

/// The log-odds of the options in fixed point.
[[nodiscard]] LogOdds log_odds_of(const VoxelGridOptions& options);

/// Memory that a map with these options takes once all of it has been seen.
[[nodiscard]] double memory_mib(const VoxelGridOptions& options);

}  // namespace sidestep::voxel_grid
