#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/planning/problem.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep {

/// An item of `alternatives` of an end effector's goal.
struct AlternativeEntry {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> rpy_rad;

  [[nodiscard]] Transform pose() const {
    return transform_from_xyz_rpy(position_m, rpy_rad.value_or(Eigen::Vector3d::Zero()));
  }
  static Parameters<AlternativeEntry> parameters();
};

/// `end_effector` of a plan.
struct EndEffectorEntry : AlternativeEntry {
  std::string link;
  Eigen::Vector3d within_m = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> axis_link;
  Eigen::Vector3d axis_world = Eigen::Vector3d::UnitZ();
  std::vector<AlternativeEntry> alternatives;
  double sigma_position_m = 1e-3;
  double sigma_rotation_rad = 5e-3;

  static Parameters<EndEffectorEntry> parameters();
};

/// An item of `orientation_costs` of a plan.
struct OrientationCostEntry {
  std::string link;
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();
  double sigma_rad = 0.02;

  static Parameters<OrientationCostEntry> parameters();
};

/// An item of `axis_costs` of a plan.
struct AxisCostEntry {
  std::string link;
  Eigen::Vector3d axis_link = Eigen::Vector3d::UnitZ();
  Eigen::Vector3d axis_world = Eigen::Vector3d::UnitZ();
  double sigma_rad = 0.02;

  static Parameters<AxisCostEntry> parameters();
};

/// `posture_cost` of a plan.
struct PostureCostEntry {
  Node joints;
  double sigma = 0.5;

  static Parameters<PostureCostEntry> parameters();
};

/// The keys of a block that read_task() reads; what such a block is read into derives from this.
struct TaskEntry {
  std::optional<EndEffectorEntry> end_effector;
  std::vector<OrientationCostEntry> orientation_costs;
  std::vector<AxisCostEntry> axis_costs;
  std::optional<PostureCostEntry> posture_cost;
};
/// Declares them after what is declared already.
template <class Entry>
[[nodiscard]] Parameters<Entry> declare_task(Parameters<Entry> parameters,
                                             const char* end_effector_doc) {
  return std::move(parameters)
      .add("end_effector", &Entry::end_effector, end_effector_doc)
      .add("orientation_costs", &Entry::orientation_costs,
           "Links that are to keep an orientation along the way.")
      .add("axis_costs", &Entry::axis_costs,
           "Links of which an axis is to keep a direction along the way, e.g. upright.")
      .add("posture_cost", &Entry::posture_cost, "A posture that is preferred along the way.");
}

/// What a plan has to do besides getting from start to goal.
struct Task {
  std::vector<CostTerm> terms;
  bool frees_goal = false;  ///< The terms at kGoal are to say where the robot ends.
  std::optional<EndEffectorEntry> target = {};  ///< `end_effector`, which is among them.
};

/// Reads the task of a block with the keys of a TaskEntry. Appends a kConfig error for each name
/// that is no link or joint of the robot and each axis without direction; passes over what its
/// schema refuses.
[[nodiscard]] Task read_task(const Node& plan, const std::shared_ptr<const RobotModel>& robot,
                             std::vector<Error>& errors);

/// Whether the link that a task sends somewhere is to be below the floor, e.g. "hand_palm_link is
/// to be 0.030 m below the floor"; empty if not.
[[nodiscard]] std::string target_below_floor(const Task& task,
                                             const std::optional<FloorEntry>& floor);

}  // namespace sidestep
