#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Tolerance on joint limits: m, rad, m/s, rad/s.
inline constexpr double kLimitTolerance = 1e-6;

/// Treatment of unmeasured space. There is no default: a configuration chooses it.
enum class Space { kFree, kOccupied };

/// The plane under the robot. Maps may leave it out, because the spheres of links that stand on it
/// reach into it.
struct Floor {
  double height_m = 0.0;  ///< Everything below this z of the world is occupied, map or not,
  std::vector<std::string> except_links;  ///< but not for these, which may stand on it.
  /// Links that are above it wherever the joints are: no cost need keep them from it.
  std::vector<std::string> clear_links = {};
};

/// Where some links may be, whatever unknown space counts as: in voxels that have been observed,
/// and in those whose centres are near the robot's start, which no camera on it sees.
struct ObservedSpace {
  std::vector<std::string> links;                     ///< The centres of their spheres keep to it.
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();  ///< World frame.
  double start_radius_m = 0.0;                        ///< Horizontal, about `start_m`.
};

/// How a robot comes out of what a map takes for an obstacle, where noise, or what somebody left
/// who stood too near for any ray to get there since, would else hold it for good.
struct Leaving {
  std::vector<Eigen::Vector3d> centres_m;  ///< Of the robot's spheres where it stands. World frame.
  /// By how much each sphere may fall short of the margin there, one each; for each metre that its
  std::vector<double> depths_m;  ///< centre goes, half a metre less, down to the margin itself.
};

struct SpacePolicy {
  Space unknown = Space::kOccupied;
  Space outside = Space::kOccupied;
  std::optional<Floor> floor = std::nullopt;
  std::optional<ObservedSpace> observed = std::nullopt;  ///< Kept to by validity checks alone.
  /// Whether validity checks look at spheres that no joint moves.
  bool counts_fixed = true;
  std::shared_ptr<const Leaving> leaving = nullptr;  ///< Of validity checks alone; null: not.
};

/// At which states of the trajectory a cost applies.
enum class Placement {
  kStart,                   ///< The first support state.
  kGoal,                    ///< The last support state.
  kSupport,                 ///< Every support state.
  kSupportAndInterpolated,  ///< Those and `interpolated_checks` states within each interval.
};

struct CostTerm {
  std::shared_ptr<const StateCost> cost;
  Placement placement = Placement::kSupport;
};

/// A motion to be found: from start to goal, on support states dt_s apart, under a GP prior
/// and cost terms. Sampling planners use the start, the goal, the limits and the field;
/// optimisers use everything. Plain data, shared by reference.
struct Problem {
  std::shared_ptr<const RobotModel> robot;
  std::shared_ptr<const DistanceField> field;  ///< The one snapshot that a solve sees.
  SpacePolicy space;
  /// Where things will be while the motion lasts; null where nothing is predicted. Planners that
  /// know time keep clear of it; validity checks on a field do not know of it.
  std::shared_ptr<const Prediction> prediction;
  double prediction_from_s = 0.0;    ///< The prediction's time at the motion's begin.
  double prediction_margin_m = 0.0;  ///< Least distance between spheres and predicted sets.

  /// Least distance between spheres and obstacles, or the floor. Sampling planners keep it; the
  /// obstacle and floor costs of standard_terms() begin no nearer.
  double collision_margin_m = 0.0;

  RobotState start;
  /// The goal of sampling planners. Optimisers keep the last state here if no term is placed at
  /// kGoal; otherwise those terms alone say where the robot ends (the goal prior of
  /// standard_terms() here; a pose, wherever its link is there), and this is the configuration that
  /// guesses head for.
  RobotState goal;
  int support_states = 0;  ///< At least 3, both ends included.
  double dt_s = 0.0;
  Eigen::VectorXd qc;           ///< Diagonal of Qc, one positive value a joint.
  int interpolated_checks = 0;  ///< States between each two support states that costs see.
  double speed_fraction = 1.0;  ///< Share of the velocity limits that a plan may use, (0, 1].
  std::vector<CostTerm> terms;

  /// Fails with kInvalidArgument, naming the joint or the number, where the problem is invalid:
  /// sizes, NaN, limits broken by start or goal.
  [[nodiscard]] Result<void> validate() const;
};

/// The weights of the standard cost terms (docs/numerics.md).
struct CostSettings {
  double epsilon_m = 0.5;         ///< Obstacles, floor: cost begins this far from a sphere.
  double sigma_obstacle = 0.05;   ///< m; of obstacles, floor and what moves.
  double epsilon_moving_m = 0.3;  ///< What is predicted: the same; 0 leaves the term out.
  double self_collision_epsilon_m = 0.02;
  double sigma_self_collision = 0.05;  ///< m; 0 leaves the term out.
  Placement self_collision_placement = Placement::kSupportAndInterpolated;
  double sigma_position_limit = 0.01;   ///< m, rad; 0 leaves the term out.
  double position_limit_margin = 0.01;  ///< m, rad
  double sigma_velocity_limit = 0.05;   ///< m/s, rad/s; 0 leaves the term out.
  double sigma_sideways_mps = 0.005;    ///< Of a rolling base, across its wheels; 0 leaves it out.
  double sigma_endpoint = 1e-4;         ///< Of start and goal, position and velocity.
  /// False leaves the goal configuration to terms to be added at kGoal, and holds only the goal's
  /// velocity ("goal_velocity").
  bool hold_goal = true;
};

/// Adds the term "moving" for problem.prediction, which begins no nearer than prediction_margin_m;
/// nothing where there are no predicted sets, or the settings leave it out.
void add_moving_term(const CostSettings& settings, Problem& problem);

/// The standard terms for problem.robot, space, field, prediction, start and goal: obstacle, floor
/// (where there is one), moving (where something may be), self-collision, position limits, velocity
/// limits (scaled by speed_fraction), a rolling base's speed across its wheels, start, goal.
[[nodiscard]] std::vector<CostTerm> standard_terms(const Problem& problem,
                                                   const CostSettings& settings);

}  // namespace sidestep
