#pragma once

#include <memory>
#include <string>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::dynamic_edt {

struct Options {
  double max_distance_m = 0.8;
  std::string unknown;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("max_distance_m", &Options::max_distance_m, "Distances are cut off here.",
             {.unit = "m", .min = 0.01, .max = 10.0})
        .add("unknown", &Options::unknown, "What voxels that were never observed count as.",
             {.required = true, .choices = {"free", "occupied"}});
  }
};

/// Distances by dynamicEDT3D on the mapper's OctoMap; `workers` must outlive it.
[[nodiscard]] std::unique_ptr<FieldBuilder> make_dynamic_edt_builder(const Options& options,
                                                                     WorkerPool& workers);

}  // namespace sidestep::dynamic_edt
