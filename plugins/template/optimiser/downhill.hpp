#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace downhill {

struct Options {
  int max_iterations = 200;
  double relative_tolerance = 1e-4;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("max_iterations", &Options::max_iterations, "Stop after so many steps.",
             {.min = 1, .max = 1e6})
        .add("relative_tolerance", &Options::relative_tolerance,
             "Stop where a step takes off less than this share of the cost.",
             {.min = 0.0, .max = 1.0});
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Optimiser>> create(const Options& options,
                                                              const sidestep::HostContext& context);

}  // namespace downhill
