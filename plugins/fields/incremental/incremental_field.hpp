#pragma once

#include <memory>
#include <string>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::incremental {

struct Options {
  bool is_signed = false;
  double max_distance_m = 0.8;
  std::string unknown;
  std::string connectivity = "24";

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("signed", &Options::is_signed,
             "Negative inside obstacles: the transform of the occupancy minus that of its inverse.")
        .add("max_distance_m", &Options::max_distance_m,
             "Distances are cut off here; 0 for no limit.", {.unit = "m", .min = 0.0})
        .add("unknown", &Options::unknown, "What voxels that were never observed count as.",
             {.required = true, .choices = {"free", "occupied"}})
        .add("connectivity", &Options::connectivity,
             "Neighbours that a closest obstacle is handed to: 6 by faces, 18 and edges, 26 and "
             "corners, 24 as FIESTA: faces, edges and two voxels along each axis.",
             {.choices = {"6", "18", "24", "26"}});
  }
};

/// FIESTA's distance field on a mapper's occupancy; `workers` must outlive it.
[[nodiscard]] std::unique_ptr<FieldBuilder> make_incremental_builder(const Options& options,
                                                                     WorkerPool& workers);

}  // namespace sidestep::incremental
