#include "chain_model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/index.hpp>

namespace sidestep {

void ProblemMemory::remember(const Problem& problem) {
  robot_ = problem.robot;
  support_states_ = problem.support_states;
  interpolated_checks_ = problem.interpolated_checks;
  dt_s_ = problem.dt_s;
  qc_ = problem.qc;
  terms_ = problem.terms;
}

ProblemChange ProblemMemory::change_to(const Problem& problem) const {
  ProblemChange change;
  change.chain =
      robot_ != problem.robot || support_states_ != problem.support_states ||
      interpolated_checks_ != problem.interpolated_checks || dt_s_ != problem.dt_s ||
      qc_.size() != problem.qc.size() || qc_ != problem.qc ||
      !std::ranges::equal(terms_, problem.terms, {}, &CostTerm::placement, &CostTerm::placement);
  if (change.chain) return change;
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    if (terms_[t].cost == problem.terms[t].cost) continue;
    switch (terms_[t].placement) {
      case Placement::kStart: change.start = true; break;
      case Placement::kGoal: change.goal = true; break;
      case Placement::kSupport:
      case Placement::kSupportAndInterpolated: change.along = true; break;
    }
  }
  return change;
}

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

void ChainModel::reset(const Problem& problem, const Trajectory& initial,
                       const std::optional<BodyChain::Base>& body) {
  is_kept_ = false;
  unchanged_ = 0;
  if (costs_.reset(problem, body)) costs_.prepare(system_);
  costs_.resize(current_);
  costs_.resize(trial_);
  hold_start_ = !is_held(problem, Placement::kStart);
  hold_goal_ = !is_held(problem, Placement::kGoal);

  double* to = current_.support.data();
  for (int i = 0; i < initial.size(); ++i) {
    to = std::ranges::copy(initial.q(i), to).out;
    to = std::ranges::copy(initial.qdot(i), to).out;
  }
  put_held_ends(problem);
  costs_.evaluate(current_);
}

void ChainModel::put_held_ends(const Problem& problem) {
  double* first = current_.support.data();
  if (hold_start_) put(problem.start, first);
  if (hold_goal_) put(problem.goal, first + (costs_.states() - 1) * 2 * costs_.dof());
}

void ChainModel::keep(const Problem& problem) {
  if (!current_.has_normals) costs_.evaluate(current_);
  memory_.remember(problem);
  is_kept_ = std::isfinite(current_.cost);
}

bool ChainModel::is_at(std::span<const double> q, std::span<const double> qdot, int state) const {
  const auto dof = static_cast<std::ptrdiff_t>(costs_.dof());
  const auto at = current_.support.begin() + state * 2 * dof;
  return std::equal(q.begin(), q.end(), at) && std::equal(qdot.begin(), qdot.end(), at + dof);
}

bool ChainModel::resume(const Problem& problem, const Trajectory& initial) {
  if (!std::exchange(is_kept_, false)) return false;
  const ProblemChange change = memory_.change_to(problem);
  if (change.chain) return false;
  const int last = costs_.states() - 1;
  for (int i = hold_start_ ? 1 : 0; i <= (hold_goal_ ? last - 1 : last); ++i) {
    if (!is_at(initial.q(i), initial.qdot(i), i)) return false;
  }
  const bool ends_moved =
      (hold_start_ && !is_at(as_span(problem.start.q), as_span(problem.start.qdot), 0)) ||
      (hold_goal_ && !is_at(as_span(problem.goal.q), as_span(problem.goal.qdot), last));
  costs_.replace(problem);
  if (change.along || ends_moved) {
    put_held_ends(problem);
    costs_.evaluate(current_);
    unchanged_ = 0;
    return true;
  }
  if (change.goal) {
    costs_.evaluate_end(current_, Placement::kGoal);
    unchanged_ = std::min(unchanged_, last);
  }
  if (change.start) {
    costs_.evaluate_end(current_, Placement::kStart);
    unchanged_ = 0;
  }
  return true;
}

Trajectory ChainModel::trajectory() const {
  Trajectory out = make_trajectory(costs_.dof(), costs_.states(), costs_.dt_s());
  const double* x = current_.support.data();
  for (int i = 0; i < out.size(); ++i) {
    std::copy_n(x, out.dof, out.q(i).begin());
    std::copy_n(x + out.dof, out.dof, out.qdot(i).begin());
    x += 2 * out.dof;
  }
  return out;
}

void ChainModel::linearise() {
  if (!current_.has_normals) costs_.evaluate(current_);
  system_.clear(unchanged_);
  costs_.assemble(current_, system_);
  if (hold_start_) system_.hold(0);
  if (hold_goal_) system_.hold(system_.states() - 1);
  system_.seal();
  unchanged_ = system_.states();
}

double ChainModel::try_step(std::span<const double> step, double linearised_below) {
  for (std::size_t i = 0; i < step.size(); ++i) {
    trial_.support[i] = current_.support[i] + step[i];
  }
  costs_.finish_step(current_.support, trial_.support);
  costs_.evaluate(trial_, linearised_below);
  return trial_.cost;
}

}  // namespace sidestep
