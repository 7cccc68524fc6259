#pragma once

#include "replan_types.hpp"
#include "replan_world.hpp"

namespace sidestep {

/// Runs one episode in its world: the closed loop of Finean 2021, Algorithm 1, by the clock that
/// the settings name, and then what truly happened. A task that fails, a plugin that fails while
/// the robot moves, are a record with a reason; an error is one that leaves nothing to measure.
/// [main]
[[nodiscard]] Result<EpisodeRecord> run_episode(ExperimentContext& context,
                                                const ReplanConfiguration& settings,
                                                ReplanWorld world, std::int64_t episode);

}  // namespace sidestep
