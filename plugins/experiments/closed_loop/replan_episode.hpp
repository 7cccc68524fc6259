#pragma once

#include <functional>
#include <string>

#include "episode_progress.hpp"
#include "replan_mapping.hpp"
#include "replan_types.hpp"
#include "replan_world.hpp"

namespace sidestep {

/// Asked after each step; why the episode is to end before its goal, or nothing.
using EpisodeWatch = std::function<std::string(Stamp now, const Replanner& replanner)>;

/// What an episode takes place in.
struct EpisodeParts {
  const ReplanConfiguration& settings;
  ReplanWorld& world;
  SnapshotSlot& slot;
  EpisodeMapping& mapping;         ///< Attached.
  EpisodeWatch watch;              ///< May be empty.
  EpisodeProgress::Tell progress;  ///< May be empty.
};

/// Runs one episode: the closed loop of Finean 2021, Algorithm 1, by the clock that the settings
/// name, from where the clock is, and then what truly happened. Leaves the robot at rest and nobody
/// mapping. A task that fails, a plugin that fails while the robot moves, are a record with a
/// reason; an error is one that leaves nothing to measure. [main]
[[nodiscard]] Result<EpisodeRecord> run_episode(ExperimentContext& context,
                                                const EpisodeParts& parts, std::int64_t episode);

/// The same in a world of its own, with a map of its own.
[[nodiscard]] Result<EpisodeRecord> run_episode(ExperimentContext& context,
                                                const ReplanConfiguration& settings,
                                                ReplanWorld world, std::int64_t episode,
                                                EpisodeProgress::Tell progress);

}  // namespace sidestep
