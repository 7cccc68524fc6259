#include "options.hpp"

#include <cmath>

namespace sidestep::octomap_mapper {
namespace {

/// OctoMap's keys are 16 bits, with the world's origin in the middle.
constexpr double kKeysEachWay = 32768.0;
constexpr double kAlignment_vox = 1e-4;

std::string text(double value) { return detail::number_text(value); }

using Mistakes = std::vector<OptionMistake>;

/// Whether the grid's voxels are leaves that an OctoMap can have.
void check_alignment(const OctomapOptions& options, Mistakes& mistakes) {
  bool reaches_beyond = false;
  for (int axis = 0; axis < 3; ++axis) {
    const double first = options.origin_m[axis] / options.resolution_m;
    if (std::abs(first - std::round(first)) > kAlignment_vox) {
      mistakes.push_back({{"origin_m[" + std::to_string(axis) + "]", "resolution_m"},
                          "must be a multiple of resolution_m, as OctoMap's voxels are; " +
                              text(options.origin_m[axis]) + " is not",
                          "use " + text(std::round(first) * options.resolution_m)});
    }
    reaches_beyond |= first < -kKeysEachWay || first + options.size_vox[axis] > kKeysEachWay;
  }
  if (reaches_beyond) {
    mistakes.push_back({{"size_vox", "origin_m"},
                        "and origin_m reach beyond 32768 voxels from the world's origin, where "
                        "OctoMap ends",
                        {}});
  }
}

void check_model(const OctomapOptions& options, Mistakes& mistakes) {
  if (!(options.prob_hit > 0.5 && options.prob_hit < 1.0)) {
    mistakes.push_back(
        {{"prob_hit"}, "must be above 0.5 and below 1, not " + text(options.prob_hit), {}});
  }
  if (!(options.prob_miss > 0.0 && options.prob_miss < 0.5)) {
    mistakes.push_back(
        {{"prob_miss"}, "must be above 0 and below 0.5, not " + text(options.prob_miss), {}});
  }
  if (!(0.0 < options.clamp_min && options.clamp_min < options.clamp_max &&
        options.clamp_max < 1.0)) {
    mistakes.push_back({{"clamp_min", "clamp_max"},
                        "must be above 0 and below clamp_max, and that below 1; they are " +
                            text(options.clamp_min) + " and " + text(options.clamp_max),
                        {}});
  } else if (!(options.occupied_at > options.clamp_min &&
               options.occupied_at <= options.clamp_max)) {
    mistakes.push_back(
        {{"occupied_at", "clamp_min", "clamp_max"},
         "must be above clamp_min and at most clamp_max, or no voxel ever changes; " +
             text(options.occupied_at) + " is not",
         {}});
  }
}

}  // namespace

Parameters<OctomapOptions> OctomapOptions::parameters() {
  using O = OctomapOptions;
  return declare_measurement(std::move(
      declare_grid(Parameters<O>())
          .add("prob_hit", &O::prob_hit, "Probability of occupancy given a hit.",
               {.min = 0.5, .max = 1.0})
          .add("prob_miss", &O::prob_miss, "Probability of occupancy given a ray passing through.",
               {.min = 0.0, .max = 0.5})
          .add("clamp_min", &O::clamp_min, "Lower clamp of the probability.",
               {.min = 0.0, .max = 1.0})
          .add("clamp_max", &O::clamp_max, "Upper clamp of the probability.",
               {.min = 0.0, .max = 1.0})
          .add("occupied_at", &O::occupied_at, "A voxel is occupied from this probability on.",
               {.min = 0.0, .max = 1.0})));
}

std::vector<OptionMistake> OctomapOptions::check() const {
  // What is allocated at once, two bitsets; the tree follows what is seen.
  const double bitsets_mib = voxels_of_blocks(*this) / 4.0 / (1 << 20);
  Mistakes mistakes = check_map_options(*this, bitsets_mib);
  check_alignment(*this, mistakes);
  check_model(*this, mistakes);
  return mistakes;
}

}  // namespace sidestep::octomap_mapper
