#pragma once

#include <memory>

#include <sidestep/plugin/plugin.hpp>

namespace obeys_exactly {

struct Options {
  sidestep::Node start;
  double start_tolerance = 0.05;
  double velocity_tolerance = 0.05;

  static sidestep::Parameters<Options> parameters() {
    return sidestep::Parameters<Options>()
        .add("start", &Options::start,
             "Where the robot stands at first: a map of joint names to m or rad, others at 0. What "
             "runs the loop fills it in, by this name.")
        .add("start_tolerance", &Options::start_tolerance,
             "A trajectory is refused that begins farther from where a joint is, in m or rad.",
             {.min = 0.0})
        .add("velocity_tolerance", &Options::velocity_tolerance,
             "And one that is faster than a joint's limit by more than this share of it.",
             {.min = 0.0});
  }
};

/// What the host calls, and the tests.
sidestep::Result<std::unique_ptr<sidestep::Executor>> create(const Options& options,
                                                             const sidestep::HostContext& context);

}  // namespace obeys_exactly
