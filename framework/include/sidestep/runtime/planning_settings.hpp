#pragma once

#include <optional>
#include <string>
#include <vector>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

namespace sidestep {

/// `planning.floor`.
struct FloorEntry : Floor {
  static Parameters<FloorEntry> parameters();
};

/// The `planning` block of a configuration: how a problem is posed to any optimiser.
struct PlanningSettings : CostSettings {
  std::string unknown;  ///< "free" or "occupied".
  std::string outside;
  std::optional<FloorEntry> floor;  ///< Left out: the one that the robot stands on, if it does.
  double max_unknown_share = 0.1;
  double dt_s = 0.25;
  double speed_fraction = 0.8;
  double acceleration_fraction = 0.9;
  double assumed_ramp_s = 0.5;
  std::optional<double> duration_s;
  double duration_scale = 2.0;
  bool retime = true;
  double qc = 1.0;
  int interpolated_checks = 4;
  std::string self_collision_states = "support_and_interpolated";  ///< Or "support".
  double collision_margin_m = 0.0;
  double time_limit_s = 10.0;
  int attempts = 1;

  static Parameters<PlanningSettings> parameters();
  [[nodiscard]] SpacePolicy space() const;
  /// What a plan may use of the robot's limits.
  [[nodiscard]] MotionLimits limits(const RobotDescription& robot) const;
};

/// An item of `check.allowed_contacts`.
struct AllowedContactEntry : AllowedContact {
  static Parameters<AllowedContactEntry> parameters();
};

/// The `check` block: what a plan must pass before it counts.
struct CheckSettings {
  double margin_m = 0.0;
  double max_step_m = 0.02;
  double shape_max_step_m = 0.01;
  double speed_fraction = 1.0;
  double acceleration_fraction = 1.0;
  std::vector<AllowedContactEntry> allowed_contacts;
  std::string certificate = "none";

  [[nodiscard]] bool wants_certificate() const { return certificate != "none"; }
  static Parameters<CheckSettings> parameters();
  [[nodiscard]] FieldCheckSettings of_field() const;
  /// Without the allowed contacts, which are the true scene's.
  [[nodiscard]] ShapeCheckSettings of_shapes() const;
};

/// Appends a kConfig error for each name in `floor.except_links` of a `planning` block that is no
/// link of the robot; what does not fit the block's schema is passed over.
void check_floor(const Node& planning, const RobotDescription& robot, std::vector<Error>& errors);

/// Appends a kConfig error for each name in the allowed contacts of a `check` block that is no link
/// of the robot or no object of the scene. `scene` may be null: objects are then passed over, as is
/// what does not fit the block's schema.
void check_allowed_contacts(const Node& check, const RobotDescription& robot, const Scene* scene,
                            std::vector<Error>& errors);

/// A `start` or `goal` block: a configuration of the robot.
struct RobotStateEntry {
  std::string pose;
  Node joints;

  static Parameters<RobotStateEntry> parameters();
};

/// From start to goal in `field`: horizon, prior and standard terms as the settings say.
/// The time is settings.duration_s or, where that is not given, settings.duration_scale times the
/// least in which each joint by itself could make its way (least_time_s); in steps of dt_s, at
/// least two of them, at most 9,999. `time_scale` >= 1 stretches it.
[[nodiscard]] Problem make_problem(std::shared_ptr<const RobotModel> robot,
                                   std::shared_ptr<const DistanceField> field,
                                   const PlanningSettings& settings, const Eigen::VectorXd& q_start,
                                   const Eigen::VectorXd& q_goal, double time_scale = 1.0);

/// The same from a robot that moves; where the settings give no duration, the time in which it
/// could come to rest is added.
[[nodiscard]] Problem make_problem(std::shared_ptr<const RobotModel> robot,
                                   std::shared_ptr<const DistanceField> field,
                                   const PlanningSettings& settings, const RobotState& start,
                                   const Eigen::VectorXd& q_goal, double time_scale = 1.0);

/// Reads a configuration of the robot: `{pose: NAME, joints: {NAME: value, ...}}`, where
/// `joints` overrides the named pose, and together they give every joint, but for those that
/// `otherwise`, where there is one, gives. Appends a kConfig error for each unknown pose, unknown
/// or missing joint, and value beyond its joint's limits. The block has been checked against
/// RobotStateEntry's schema. Returns what could be read.
[[nodiscard]] Eigen::VectorXd read_robot_state(const Node& block, const RobotDescription& robot,
                                               std::vector<Error>& errors,
                                               const Eigen::VectorXd* otherwise = nullptr);

}  // namespace sidestep
