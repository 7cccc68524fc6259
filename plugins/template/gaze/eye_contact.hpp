#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace eye_contact {

struct Options {
  double within_m = 4.0;
  double below_top_m = 0.1;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("within_m", &Options::within_m, "What is farther away is not looked at.",
             {.unit = "m", .min = 0.0})
        .add("below_top_m", &Options::below_top_m, "So far below the top of a track are its eyes.",
             {.unit = "m", .min = 0.0});
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Gaze>> create(const Options& options,
                                                         const sidestep::HostContext& context);

}  // namespace eye_contact
