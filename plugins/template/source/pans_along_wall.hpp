#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace pans_along_wall {

struct Options {
  int frames = 60;
  double rate_hz = 10.0;
  double distance_m = 2.0;
  double speed_mps = 0.3;
  double pan_rad = 0.5;
  double max_range_m = 5.0;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("frames", &Options::frames, "How many there are.", {.min = 1})
        .add("rate_hz", &Options::rate_hz, "So often they are taken.",
             {.unit = "Hz", .min = 1e-3, .max = 1e6})
        .add("distance_m", &Options::distance_m, "From the camera to the wall.",
             {.unit = "m", .min = 0.01})
        .add("speed_mps", &Options::speed_mps, "Of the camera along the wall.", {.unit = "m/s"})
        .add("pan_rad", &Options::pan_rad, "How far it turns to either side.",
             {.unit = "rad", .min = 0.0, .max = 3.0})
        .add("max_range_m", &Options::max_range_m, "Nothing comes back from farther away.",
             {.unit = "m", .min = 0.01});
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Source>> create(const Options& options,
                                                           const sidestep::HostContext& context);

}  // namespace pans_along_wall
