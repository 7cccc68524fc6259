#include "link_cost.hpp"

#include <algorithm>

namespace sidestep {

void LinkCost::evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const {
  Scratch::Scope scope(scratch);
  const auto n = static_cast<std::size_t>(states.count);
  const auto dof = static_cast<std::size_t>(states.dof);
  const auto m = static_cast<std::size_t>(residual_count());
  const auto poses = scope.array<Transform>(robot_->description().links.size());
  const auto residuals = scope.doubles(n * m);
  const auto derivatives = scope.array<LinkForce>(n * m);
  for (std::size_t i = 0; i < n; ++i) {
    robot_->link_poses(states.q.subspan(i * dof, dof), poses, scratch);
    const auto of_state = derivatives.subspan(i * m, m);
    measure(poses[static_cast<std::size_t>(link_)], residuals.subspan(i * m, m), of_state);
    for (LinkForce& derivative : of_state) {
      derivative.row = static_cast<int>(i);
      derivative.link = link_;
    }
  }
  if (!out.residuals.empty()) std::ranges::copy(residuals, out.residuals.begin());
  if (!out.jacobian_q.empty()) {
    robot_->pull_back(states.q, derivatives, out.jacobian_q, scratch);
  }
  std::ranges::fill(out.jacobian_qdot, 0.0);
}

}  // namespace sidestep
