#pragma once

#include <memory>
#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "edt_field.hpp"
#include "transform.hpp"

namespace sidestep::edt_cuda {

struct Options : edt::Options {
  int device = 0;
  std::string fallback = "none";

  static Parameters<Options> parameters() {
    return edt::declare_transform(Parameters<Options>())
        .add("device", &Options::device, "Number of the CUDA device, counted from 0.", {.min = 0})
        .add("fallback", &Options::fallback,
             "What happens where the device cannot be used, or is lost: none: an error; cpu: the "
             "run goes on with edt, and the log says so.",
             {.choices = {"none", "cpu"}});
  }
};

/// The exact Euclidean distance transform of a mapper's occupancy, by a transform that `make`
/// makes. Reads the map where it lies if that is on the transform's device, else uploads what
/// changed. `workers` and `log` outlive it.
[[nodiscard]] std::unique_ptr<FieldBuilder> make_edt_cuda_builder(const Options& options,
                                                                  WorkerPool& workers, Log& log,
                                                                  MakeTransform make);

}  // namespace sidestep::edt_cuda
