#pragma once

#include <memory>
#include <string>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::esdf {

struct Options {
  bool is_signed = true;
  double max_distance_m = 0.8;
  std::string unknown;
  std::string propagation = "quasi_euclidean";
  double fixed_band_vox = 2.0;
  double min_change_m = 0.001;

  static Parameters<Options> parameters() {
    return Parameters<Options>()
        .add("signed", &Options::is_signed, "Negative inside obstacles, else 0 there.")
        .add("max_distance_m", &Options::max_distance_m, "Distances are cut off here.",
             {.unit = "m", .min = 0.01, .max = 10.0})
        .add("unknown", &Options::unknown,
             "What voxels that were never observed count as; ignored: waves stop at them, and they "
             "have the distance max_distance_m, as in Voxblox.",
             {.required = true, .choices = {"free", "occupied", "ignored"}})
        .add("propagation", &Options::propagation,
             "quasi_euclidean: along straight and diagonal steps; full_euclidean: along the "
             "straight line to the voxel where the wave began.",
             {.choices = {"quasi_euclidean", "full_euclidean"}})
        .add("fixed_band_vox", &Options::fixed_band_vox,
             "Distances smaller than this are the TSDF's own; at most its truncation distance.",
             {.unit = "vox", .min = 1.0, .max = 100.0})
        .add("min_change_m", &Options::min_change_m,
             "Smaller changes of the TSDF start no wave; the largest error that this leaves.",
             {.unit = "m", .min = 0.0, .max = 1.0});
  }
};

/// Distances spread from a mapper's TSDF; `workers` must outlive it.
[[nodiscard]] std::unique_ptr<FieldBuilder> make_esdf_builder(const Options& options,
                                                              WorkerPool& workers);

}  // namespace sidestep::esdf
