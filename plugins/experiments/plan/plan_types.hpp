#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/attached_settings.hpp>
#include <sidestep/runtime/cost_plugins.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/task_settings.hpp>

namespace sidestep {

/// One entry of `experiment.plans`.
struct PlanEntry {
  std::string name;
  RobotStateEntry start;
  RobotStateEntry goal;
  std::vector<AttachedEntry> attached;
  std::optional<EndEffectorEntry> end_effector;
  std::vector<OrientationCostEntry> orientation_costs;
  std::vector<AxisCostEntry> axis_costs;
  std::optional<PostureCostEntry> posture_cost;
  std::vector<PluginCostEntry> costs;

  static Parameters<PlanEntry> parameters();
};

/// The `experiment` block of a plan experiment.
struct PlanExperimentSettings : ExperimentSettings {
  std::int64_t max_frames = 0;
  int depth_pictures = 6;
  std::vector<double> slice_heights_m;
  std::vector<PlanEntry> plans;

  static Parameters<PlanExperimentSettings> parameters();
};

/// Result of mapping.
struct MapRecord {
  std::vector<MappingStep> steps;
  std::vector<Error> bad_frames;
  std::shared_ptr<const DistanceField> field;
  std::int64_t occupied_vox = 0;
  std::int64_t known_vox = 0;
  std::string left_out;  ///< Which frames of the source are not in it, in words; empty if all are.
  std::string empty_reason;  ///< Why there is nothing in it to plan among; empty if there is.
  bool interrupted = false;
  std::optional<Error> fault;  ///< That ended the run before its end, mapping or planning.
};

/// Result of retiming a path.
struct RetimingRecord {
  double before_s = 0.0;   ///< The optimiser's duration; the plan's own is the trajectory's.
  double deviation = 0.0;  ///< Of any joint from the optimiser's path, m or rad.
  double retime_ms = 0.0;
};

/// Result of one plan.
struct PlanRecord {
  std::string name;
  std::shared_ptr<const RobotModel> robot;  ///< With all that it carries in this plan.
  std::vector<std::string> attached;        ///< Names of that.
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;  ///< With an end-effector goal, only where the search begins.
  Task task;
  int attempts = 0;
  int support_states = 0;
  double initial_length_s = 0.0;
  Solution solution;  ///< Its trajectory is the one to be sent: retimed, where that was asked for.
  std::optional<RetimingRecord> retiming;
  std::optional<Verdict> in_snapshot;  ///< Spheres against the field that was planned in.
  std::optional<Verdict> in_voxels;    ///< Shapes against the occupied voxels.
  std::optional<Verdict> in_scene;     ///< Shapes against the true scene, where it is known.
  std::string reason;                  ///< Why it is not a success; empty if it is.
  bool interrupted = false;

  [[nodiscard]] bool success() const noexcept { return reason.empty(); }
  [[nodiscard]] bool has_trajectory() const noexcept { return solution.trajectory.size() > 0; }
  [[nodiscard]] bool valid_independent() const noexcept {
    return in_voxels && in_voxels->valid() && (!in_scene || in_scene->valid());
  }
  /// The smaller of both checks in the map; nothing if none was made. The true scene, whose floor
  /// the robot stands on, has its clearance in its own verdict.
  [[nodiscard]] std::optional<double> min_clearance_m() const noexcept;
  /// Whether that is as far as was looked: nothing was found nearer.
  [[nodiscard]] bool clearance_is_bound() const noexcept;
};

}  // namespace sidestep
