#include "options.hpp"

#include <cmath>

namespace sidestep::octomap_mapper {
namespace {

/// OctoMap's keys are 16 bits, with the world's origin in the middle.
constexpr double kKeysEachWay = 32768.0;
constexpr double kAlignment_vox = 1e-4;
tl::unexpected<Error> wrong(const std::string& parameter, const std::string& what,
                            std::string hint = {}) {
  return wrong_parameter(parameter, what, "octomap", std::move(hint));
}

std::string text(double value) { return detail::number_text(value); }

/// Whether the grid's voxels are leaves that an OctoMap can have.
Result<void> check_alignment(const OctomapOptions& options) {
  for (int axis = 0; axis < 3; ++axis) {
    const double first = options.origin_m[axis] / options.resolution_m;
    if (std::abs(first - std::round(first)) > kAlignment_vox) {
      return wrong("origin_m",
                   "must be a multiple of resolution_m along each axis, as OctoMap's voxels are; " +
                       text(options.origin_m[axis]) + " is not",
                   "use " + text(std::round(first) * options.resolution_m));
    }
    if (first < -kKeysEachWay || first + options.size_vox[axis] > kKeysEachWay) {
      return wrong("size_vox",
                   "and origin_m reach beyond 32768 voxels from the world's origin, "
                   "where OctoMap ends");
    }
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

}  // namespace

Fields<OctomapOptions> OctomapOptions::fields() {
  using O = OctomapOptions;
  return declare_measurement(std::move(
      declare_grid(Fields<O>())
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

Result<void> check_options(const OctomapOptions& options) {
  // What is allocated at once, two bitsets; the tree follows what is seen.
  const double bitsets_mib = voxels_of_blocks(options) / 4.0 / (1 << 20);
  if (auto ok = check_map_options(options, bitsets_mib, "octomap"); !ok) return ok;
  if (auto ok = check_alignment(options); !ok) return ok;
  return check_model(options);
}

}  // namespace sidestep::octomap_mapper
