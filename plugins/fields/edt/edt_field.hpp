#pragma once

#include <memory>
#include <string>
#include <utility>

#include <sidestep/core/worker_pool.hpp>
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

}  // namespace sidestep::edt
