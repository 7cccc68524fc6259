#pragma once

#include <memory>
#include <string>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "edt_field.hpp"

namespace sidestep::incremental {

struct Options : edt::Options {
  std::string connectivity = "24";

  static Parameters<Options> parameters() {
    return edt::declare_transform(Parameters<Options>())
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
