#pragma once

#include <memory>
#include <optional>

#include <sidestep/planning/executor.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep::simulated {

struct Options {
  Node start;
  Node goals;
  double delay_s = 0.0;
  double lag_s = 0.0;
  double position_noise = 0.0;
  double drift_share = 0.0;
  double drift_rad_per_m = 0.0;
  double measured_rate_hz = 200.0;
  double start_tolerance = 0.05;
  double velocity_tolerance = 0.05;
  double assumed_ramp_s = 0.5;
  std::optional<double> head_fails_at_s;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("start", &O::start,
             "Where the robot stands at first: a map of joint names to m or rad; joints left out "
             "are at 0.")
        .add(
            "goals", &O::goals,
            "For experiments of type deploy: goals that come while the robot runs, a list of "
            "`{at_s, goal: {pose, joints}, end_effector, ...}`; with `at_s` alone, the robot is to "
            "stop.")
        .add("delay_s", &O::delay_s,
             "After this long the robot acts on what it is told, a stop included.",
             {.unit = "s", .min = 0.0, .max = 10.0})
        .add("lag_s", &O::lag_s,
             "Time constant with which its drives follow a trajectory (first order); 0: exactly.",
             {.unit = "s", .min = 0.0, .max = 10.0})
        .add("position_noise", &O::position_noise,
             "Standard deviation of a measured joint position, m or rad.", {.min = 0.0})
        .add("drift_share", &O::drift_share,
             "How far a base that moves in the plane comes to be from where it measures itself, as "
             "a "
             "share of its way; either way, by the seed.",
             {.min = 0.0, .max = 1.0})
        .add("drift_rad_per_m", &O::drift_rad_per_m, "The same of its heading.",
             {.unit = "rad/m", .min = 0.0, .max = 10.0})
        .add("measured_rate_hz", &O::measured_rate_hz,
             "How often a state is measured for those who ask later, e.g. for an image's stamp.",
             {.unit = "Hz", .min = 1.0, .max = 1000.0})
        .add("start_tolerance", &O::start_tolerance,
             "A trajectory that begins farther than this from where a joint will be is refused, m "
             "or rad.",
             {.min = 0.0})
        .add("velocity_tolerance", &O::velocity_tolerance,
             "A trajectory that is faster than a joint's limit by more than this share is refused.",
             {.min = 0.0})
        .add("assumed_ramp_s", &O::assumed_ramp_s,
             "A joint without a known acceleration limit reaches its largest velocity in this "
             "time.",
             {.unit = "s", .min = 1e-3})
        .add("head_fails_at_s", &O::head_fails_at_s,
             "From then on the head takes what it is told and does not move; left out: never.",
             {.unit = "s", .min = 0.0});
  }
};

/// A simulated robot on the host's clock; implements TrueRobot, too. Fails with kUnsupported where
/// the run has no robot, with kConfig where the start is not one of the robot's configurations.
[[nodiscard]] Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::simulated
