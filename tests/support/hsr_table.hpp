#pragma once

#include <algorithm>
#include <memory>

#include <sidestep/planning/costs.hpp>

#include "support/hsr.hpp"
#include "support/sampled_field.hpp"

/// The HSR drives around a table and reaches over it: a plan of 8 joints with all standard costs.
namespace sidestep::testing_support {

[[nodiscard]] inline double distance_to_box(const Eigen::Vector3d& p, const Eigen::Vector3d& lower,
                                            const Eigen::Vector3d& upper) {
  const Eigen::Vector3d outside = (lower - p).cwiseMax(p - upper);
  return outside.cwiseMax(0.0).norm() + std::min(outside.maxCoeff(), 0.0);
}

/// A table, a cupboard and a chair on 6 x 6 m at 5 cm, cut off at 0.8 m as a map's field is.
[[nodiscard]] inline std::shared_ptr<const DistanceField> room_with_table() {
  GridSpec grid;
  grid.origin_m = {-3.0, -3.0, -0.2};
  grid.resolution_m = 0.05;
  grid.size_vox = {128, 128, 48};
  return sampled_field(grid, [](const Eigen::Vector3d& p) {
    return std::min({0.8, distance_to_box(p, {0.6, -0.6, 0.66}, {1.4, 0.6, 0.7}),
                     distance_to_box(p, {0.65, -0.05, 0.0}, {0.75, 0.05, 0.66}),
                     distance_to_box(p, {-0.6, 1.2, 0.0}, {0.2, 1.6, 2.0}),
                     distance_to_box(p, {-0.3, -0.9, 0.0}, {0.1, -0.5, 0.8})});
  });
}

[[nodiscard]] inline Problem hsr_reaches_table(int states, int checks) {
  Problem problem;
  problem.robot = load_hsr();
  problem.field = room_with_table();
  problem.space = {Space::kFree, Space::kFree};
  const int d = problem.robot->description().dof();
  problem.start = {Eigen::VectorXd::Zero(d), Eigen::VectorXd::Zero(d)};
  problem.goal = problem.start;
  problem.start.q << -2.0, -1.2, 0.5, 0.0, 0.0, -1.57, -1.57, 0.0;  // the pose "go"
  problem.goal.q << 0.25, 0.1, 0.0, 0.34, -0.9, 0.0, -0.67, 0.0;    // "reach_table"
  const Horizon horizon = estimate_horizon(
      problem.robot->description(), {problem.start.q.data(), static_cast<std::size_t>(d)},
      {problem.goal.q.data(), static_cast<std::size_t>(d)}, 0.1, 0.8);
  problem.support_states = states;
  problem.dt_s = horizon.states * horizon.dt_s / (states - 1);
  problem.qc = Eigen::VectorXd::Ones(d);
  problem.interpolated_checks = checks;
  problem.speed_fraction = 0.9;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.2});
  return problem;
}

}  // namespace sidestep::testing_support
