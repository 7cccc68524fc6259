#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::edt {

struct Options {
  bool is_signed = false;
  double max_distance_m = 0.8;
  std::string unknown;

  static Parameters<Options> parameters();
};

/// Adds the parameters of Options. `O` is or derives from it.
template <class O>
[[nodiscard]] Parameters<O> declare_transform(Parameters<O> parameters) {
  return std::move(parameters)
      .add("signed", &Options::is_signed,
           "Negative inside obstacles: the transform of the occupancy minus that of its inverse.")
      .add("max_distance_m", &Options::max_distance_m,
           "Distances are cut off here; 0 for no limit.", {.unit = "m", .min = 0.0})
      .add("unknown", &Options::unknown, "What voxels that were never observed count as.",
           {.required = true, .choices = {"free", "occupied"}});
}

inline Parameters<Options> Options::parameters() {
  return declare_transform(Parameters<Options>());
}

/// The exact Euclidean distance transform of a mapper's occupancy; `workers` must outlive it.
[[nodiscard]] std::unique_ptr<FieldBuilder> make_edt_builder(const Options& options,
                                                             WorkerPool& workers);

/// The first squared distance, in voxels, at or beyond a limit; that of the grid's diagonal where
/// the limit is 0, for none, or farther.
[[nodiscard]] std::uint32_t cap_vox2(double max_distance_m, const GridSpec& grid);

/// Metres by squared distance in voxels, from 0 to the cap, which is the limit itself where there
/// is one: infinity for none.
[[nodiscard]] std::vector<float> distance_table(double resolution_m, std::uint32_t cap,
                                                double max_distance_m);

}  // namespace sidestep::edt
