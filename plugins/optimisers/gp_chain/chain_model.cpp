#include "chain_model.hpp"

#include <algorithm>

namespace sidestep {
namespace {

bool is_held(const Problem& problem, Placement end) {
  return std::ranges::any_of(problem.terms,
                             [end](const CostTerm& term) { return term.placement == end; });
}

void put(const RobotState& state, double* to) {
  std::copy_n(state.q.data(), state.q.size(), to);
  std::copy_n(state.qdot.data(), state.qdot.size(), to + state.q.size());
}

}  // namespace

void ChainModel::reset(const Problem& problem, const Trajectory& initial) {
  problem_ = &problem;
  costs_.reset(problem);
  costs_.resize(current_);
  costs_.resize(trial_);
  costs_.prepare(system_);
  hold_start_ = !is_held(problem, Placement::kStart);
  hold_goal_ = !is_held(problem, Placement::kGoal);

  double* to = current_.support.data();
  for (int i = 0; i < initial.size(); ++i) {
    to = std::ranges::copy(initial.q(i), to).out;
    to = std::ranges::copy(initial.qdot(i), to).out;
  }
  if (hold_start_) put(problem.start, current_.support.data());
  if (hold_goal_) put(problem.goal, to - 2 * costs_.dof());
  costs_.evaluate(current_);
}

void ChainModel::linearise() {
  system_.clear();
  costs_.assemble(current_, system_);
  if (hold_start_) system_.hold(0);
  if (hold_goal_) system_.hold(system_.states() - 1);
  system_.seal();
}

double ChainModel::try_step(std::span<const double> step) {
  for (std::size_t i = 0; i < step.size(); ++i) {
    trial_.support[i] = current_.support[i] + step[i];
  }
  costs_.evaluate(trial_);
  return trial_.cost;
}

}  // namespace sidestep
