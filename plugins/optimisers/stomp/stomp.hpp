#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

namespace sidestep {

/// Noise, weights and stopping rule.
struct StompSettings {
  std::string smoothness = "acceleration";  ///< Or "velocity": what the metric R is made of.
  double smoothness_weight = 1.0;
  int rollouts = 20;           ///< Of an iteration, those of earlier ones included.
  int reused = 8;              ///< The best of earlier iterations.
  double noise_s = 0.2;        ///< Standard deviation, as time at a joint's full speed.
  double noise_decay = 0.99;   ///< Of the noise, from one iteration to the next.
  double sensitivity = 10.0;   ///< h of the weights.
  double limit_margin = 0.01;  ///< m, rad
  double relative_tolerance = 1e-2;
  int patience = 30;  ///< Iterations over which the tolerance applies.
  int max_iterations = 500;

  [[nodiscard]] std::vector<OptionMistake> check() const;

  static Parameters<StompSettings> parameters();
};

/// Stochastic optimisation between fixed ends: see README.md. The rollouts of an iteration share
/// the threads of `workers`, or go one after the other where it is null; `seed` is of their noise.
[[nodiscard]] std::unique_ptr<Optimiser> make_stomp(const StompSettings& settings,
                                                    WorkerPool* workers = nullptr,
                                                    std::uint64_t seed = 1);

}  // namespace sidestep
