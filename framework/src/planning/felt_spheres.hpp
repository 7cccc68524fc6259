#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/state_cost.hpp>
#include <sidestep/planning/state_normals.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// The residuals that are not zero of a cost that has one for each sphere, in order of states.
struct FeltSpheres {
  std::span<double> residuals;
  std::span<LinkForce> forces;  ///< Their gradients by the spheres' centres.
  std::span<std::size_t> at;    ///< Their places among all residuals of the batch.
};

[[nodiscard]] inline FeltSpheres felt_spheres(std::size_t count, Scratch::Scope& scope) {
  return {scope.doubles(count), scope.array<LinkForce>(count), scope.array<std::size_t>(count)};
}

/// StateCost::linearise() of such a cost.
inline double linearise_felt(const RobotModel& robot, const StateBatch& states,
                             const FeltSpheres& felt, const StateRange& range, StateNormals& out,
                             Scratch& scratch) {
  Scratch::Scope scope(scratch);
  const auto dof = idx(states.dof);
  const std::size_t count = felt.forces.size();
  const auto rows = scope.doubles(count * dof);
  robot.pull_back(states.q, felt.forces, rows, scratch);
  double sum = 0.0;
  for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
    for (; end < count && felt.forces[end].row == felt.forces[begin].row; ++end) {
      sum += felt.residuals[end] * felt.residuals[end];
    }
    out.add_rows(range[idx(felt.forces[begin].row)], rows.subspan(begin * dof, (end - begin) * dof),
                 felt.residuals.subspan(begin, end - begin));
  }
  return 0.5 * sum;
}

/// StateCost::evaluate() of such a cost.
inline void evaluate_felt(const RobotModel& robot, const StateBatch& states,
                          const FeltSpheres& felt, const CostBatch& out, Scratch& scratch) {
  std::ranges::fill(out.residuals, 0.0);
  std::ranges::fill(out.jacobian_q, 0.0);
  std::ranges::fill(out.jacobian_qdot, 0.0);
  if (!out.residuals.empty()) {
    for (std::size_t k = 0; k < felt.at.size(); ++k) out.residuals[felt.at[k]] = felt.residuals[k];
  }
  if (out.jacobian_q.empty()) return;
  Scratch::Scope scope(scratch);
  const auto dof = idx(states.dof);
  const auto rows = scope.doubles(felt.forces.size() * dof);
  robot.pull_back(states.q, felt.forces, rows, scratch);
  for (std::size_t k = 0; k < felt.at.size(); ++k) {
    std::ranges::copy(rows.subspan(k * dof, dof),
                      out.jacobian_q.begin() + static_cast<std::ptrdiff_t>(felt.at[k] * dof));
  }
}

}  // namespace sidestep
