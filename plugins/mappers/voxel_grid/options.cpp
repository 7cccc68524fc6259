#include "options.hpp"

#include <cmath>

namespace sidestep::voxel_grid {
namespace {

std::string text(double value) { return detail::number_text(value); }

}  // namespace

Parameters<VoxelGridOptions> VoxelGridOptions::parameters() {
  using O = VoxelGridOptions;
  return declare_measurement(std::move(
      declare_sensor_model(declare_grid(Parameters<O>()))
          .add("sliding_window", &O::sliding_window,
               "Whether the grid moves with the camera along x and y, by blocks of 16 voxels; "
               "origin_m is where it lies in the first frame. What leaves it is forgotten.")
          .add("fade_half_life_s", &O::fade_half_life_s,
               "Time in which the log-odds of what is not seen halve, until it is unknown; 0: "
               "never.",
               {.unit = "s", .min = 0.0})));
}

LogOdds log_odds_of(const VoxelGridOptions& options) {
  const auto fixed = [](double log_odds) {
    return static_cast<std::int16_t>(std::lround(log_odds * LogOdds::kUnits));
  };
  return {fixed(options.l_hit), fixed(options.l_miss), fixed(options.l_min), fixed(options.l_max),
          fixed(options.occupied_at)};
}

double memory_mib(const VoxelGridOptions& options) {
  // Log-odds, two bitsets of the map, three of the frame (hits, misses, ends of rays).
  constexpr double kBytesPerVoxel = sizeof(std::int16_t) + 5.0 / 8.0;
  return voxels_of_blocks(options) * kBytesPerVoxel / (1 << 20);
}

std::vector<OptionMistake> VoxelGridOptions::check() const {
  std::vector<OptionMistake> mistakes = check_map_options(*this, memory_mib(*this));
  if (!(occupied_at > l_min && occupied_at <= l_max)) {
    mistakes.push_back({{"occupied_at", "l_min", "l_max"},
                        "must be above l_min and at most l_max, or no voxel ever changes; " +
                            text(occupied_at) + " is not",
                        {}});
  }
  const bool has_whole_blocks =
      size_vox.x() % kBlockSide_vox == 0 && size_vox.y() % kBlockSide_vox == 0;
  if (sliding_window && !has_whole_blocks) {
    mistakes.push_back({{"size_vox", "sliding_window"},
                        "must be a multiple of " + std::to_string(kBlockSide_vox) +
                            " along x and y where sliding_window is on",
                        {}});
  }
  return mistakes;
}

}  // namespace sidestep::voxel_grid
