#pragma once

#include <cstdint>
#include <memory>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/optimiser.hpp>

#include "options.hpp"

namespace sidestep::ompl_optimiser {

/// A sampling-based planner of OMPL as an Optimiser. `log` must outlive it. [planning]
[[nodiscard]] std::unique_ptr<Optimiser> make_ompl_optimiser(const Options& options,
                                                             std::uint64_t seed, Log& log);

}  // namespace sidestep::ompl_optimiser
