#pragma once

#include <memory>

#include <sidestep/mapping/field_builder.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/runtime/episode_clock.hpp>
#include <sidestep/runtime/experiment.hpp>
#include "replan_settings.hpp"

namespace sidestep {

/// All that an episode has to itself: nothing of it lives on into the next one.
struct ReplanWorld {
  std::unique_ptr<EpisodeClock> clock;
  std::shared_ptr<RobotMotion> motion;
  std::shared_ptr<const RobotModel> robot;
  PluginPtr<Source> source;
  PluginPtr<Mapper> mapper;
  PluginPtr<FieldBuilder> field_builder;
  PluginPtr<Optimiser> optimiser;
  PluginPtr<Optimiser> sampler;  ///< Null where there is none.
  PluginPtr<Executor> executor;
  TrueRobot* true_robot = nullptr;     ///< The executor's other side; null where it has none.
  std::shared_ptr<const Scene> scene;  ///< Null where it is not known.
  std::uint64_t seed = 0;              ///< The episode's.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
};

/// The robot of a run; null, and its error added, where it cannot be made.
[[nodiscard]] std::shared_ptr<const RobotModel> make_run_robot(const Configuration& configuration,
                                                               Host& host,
                                                               std::vector<Error>& errors);

/// The world of an episode: start and goal drawn, the robot at rest at its start, the clock at
/// zero. Fails where a plugin cannot be made, and where no start or goal is free.
[[nodiscard]] Result<ReplanWorld> make_replan_world(ExperimentContext& context,
                                                    const ReplanConfiguration& settings,
                                                    const std::shared_ptr<const RobotModel>& robot,
                                                    std::int64_t episode);

}  // namespace sidestep
