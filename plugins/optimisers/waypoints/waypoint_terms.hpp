#pragma once

#include <string_view>
#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/state_normals.hpp>

#include "waypoint_states.hpp"

namespace sidestep {

/// The cost terms of a problem at waypoints, but for some that an optimiser has its own way with.
/// One thread at a time.
class WaypointTerms {
 public:
  /// `left_out`: names of terms. The problem must outlive the object.
  WaypointTerms(const Problem& problem, std::vector<std::string_view> left_out);

  /// Their cost; adds its gradient by all waypoints to `gradient`.
  [[nodiscard]] double add_gradient(const WaypointStates& states, Waypoints& gradient);
  /// Their cost, and their normal equations at every state.
  [[nodiscard]] double linearise(const WaypointStates& states, StateNormals& normals);
  /// Adds the cost of each state, computed without any derivative, to `costs` (states.states()).
  void add_costs(const WaypointStates& states, std::vector<double>& costs);

 private:
  const Problem* problem_;
  std::vector<const CostTerm*> terms_;
  StateNormals normals_;
  Eigen::MatrixXd by_q_, by_qdot_;
  Scratch scratch_;
};

/// The cost of every term of a problem, the GP prior first as "gp_prior", without derivatives.
[[nodiscard]] std::vector<TermCost> term_costs(const Problem& problem,
                                               const WaypointStates& states);

}  // namespace sidestep
