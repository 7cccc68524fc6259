#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace planar_match {

struct Options {
  int points = 500;
  double drift_share = 0.02;
  double drift_rad_per_m = 0.035;
  double lost_m = 0.2;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("points", &Options::points, "About so many points of a frame are matched.",
             {.min = 50, .max = 20000})
        .add("drift_share", &Options::drift_share,
             "What odometry may drift by in the first metre, in m.", {.min = 0.0, .max = 1.0})
        .add("drift_rad_per_m", &Options::drift_rad_per_m, "By which it may turn.",
             {.unit = "rad/m", .min = 0.0, .max = 10.0})
        .add("lost_m", &Options::lost_m,
             "It is lost where the position's standard deviation is larger.",
             {.unit = "m", .min = 1e-3});
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Localiser>> create(const Options& options,
                                                              const sidestep::HostContext& context);

}  // namespace planar_match
