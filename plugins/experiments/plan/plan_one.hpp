#pragma once

#include <memory>
#include <stop_token>

#include <sidestep/core/log.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/runtime/host.hpp>

#include "plan_types.hpp"

namespace sidestep {

/// Everything that the plans of a run share: one robot, one pinned snapshot, and the checks of
/// both kinds against it. Built once mapping is over.
struct PlanWorld {
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const DistanceField> field;
  PlanningSettings planning;  ///< With the floor that the robot stands on.
  double margin_m = 0.0;      ///< That spheres must keep from obstacles.
  std::unique_ptr<ValidityCheck> in_snapshot;
  std::unique_ptr<ValidityCheck> in_voxels;
  std::unique_ptr<ValidityCheck> in_scene;  ///< Null where no scene is known.
};

/// `scene` may be null; `scene_time_s` is the scene's time when a plan starts.
[[nodiscard]] Result<PlanWorld> make_plan_world(
    std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
    const OccupancyView& occupancy, std::shared_ptr<const Scene> scene, double scene_time_s,
    const PlanningSettings& planning, const CheckSettings& check);

/// Solves and checks one plan, from other first guesses where the settings ask for it, until
/// an attempt passes both checks. A plan that fails is a record with a reason; an error is a
/// fault of the optimiser's or of a check's.
[[nodiscard]] Result<PlanRecord> make_plan(const PlanWorld& world,
                                           const PluginPtr<Optimiser>& optimiser,
                                           PlanRecord endpoints, std::uint64_t seed, Log& log,
                                           std::stop_token stop);

}  // namespace sidestep
