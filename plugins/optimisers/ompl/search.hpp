#pragma once

#include <mutex>
#include <span>
#include <string>
#include <vector>

#include <ompl/base/SpaceInformation.h>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/problem.hpp>

#include "checker.hpp"
#include "joint_space.hpp"

namespace sidestep::ompl_optimiser {

using joint_paths::Checker;
using joint_paths::JointSpace;

/// How far apart configurations are: the Euclidean norm of each joint's way times its weight, in s.
struct JointMetric {
  /// `time`: a joint weighs the time that a unit of it takes at full speed. `motion`: how far the
  /// fastest sphere's centre moves with a unit of it, at the start or at the goal, divided by the
  /// highest speed at which any joint can move one.
  std::string name = "time";
  Node weights;  ///< {joint: s per m or rad}, in place of what the metric says; or null.
};

/// Fails with kInvalidArgument for a weight of a joint that the robot has not.
[[nodiscard]] Result<void> check_weights(const JointMetric& metric, const RobotDescription& robot);

/// The weights of a metric, joint by joint, in s per unit.
[[nodiscard]] std::vector<double> weights_of(const Problem& problem, const JointMetric& metric);

/// One search: a problem in OMPL's terms. Planners with threads of their own check one at a time.
class Search {
 public:
  /// `checker` must outlive it, and looks at the problem of `space`.
  Search(JointSpace space, Checker& checker, const Deadline& deadline);

  [[nodiscard]] const JointSpace& space() const noexcept { return space_; }
  [[nodiscard]] const Deadline& deadline() const noexcept { return deadline_; }

  [[nodiscard]] bool is_clear(const ::ompl::base::State* state);
  [[nodiscard]] bool is_clear(const ::ompl::base::State* from, const ::ompl::base::State* to,
                              double resolution_m);
  [[nodiscard]] std::span<const double> values(const ::ompl::base::State* state) const;
  void to_joints(const ::ompl::base::State* state, std::span<double> q) const;
  void from_joints(std::span<const double> q, ::ompl::base::State* state) const;

 private:
  JointSpace space_;
  Checker& checker_;
  Deadline deadline_;
  std::mutex mutex_;  ///< Of checker_ and what follows.
  joint_paths::Way way_;
  std::vector<double> q_from_;
  std::vector<double> q_to_;
};

struct SearchSettings {
  double resolution_m = 0.005;  ///< Of Checker.
  bool is_projected = true;     ///< Whether the planner wants the space's default projection.
  /// Whether the planner asks of every state first whether it is valid, and then of a motion that
  /// leads there, which says it again: the first question is then not worth answering.
  bool checks_motions_to_states = false;
};

/// The space that `search` searches, ready for planners: what is valid is what its checker shows
/// clear.
[[nodiscard]] ::ompl::base::SpaceInformationPtr make_information(Search& search,
                                                                 const SearchSettings& settings);

}  // namespace sidestep::ompl_optimiser
