#include "chain_costs.hpp"

#include <algorithm>

#include <sidestep/core/index.hpp>

#include "interval_blocks.hpp"

namespace sidestep {

void ChainCosts::States::resize(int count, int dof, double spacing_s) {
  q.resize(idx(count) * idx(dof) + kLanes);
  qdot.resize(q.size());
  times_s.resize(idx(count));
  for (int i = 0; i < count; ++i) times_s[idx(i)] = i * spacing_s;
}

StateBatch ChainCosts::States::batch(int first, int count, int dof) const noexcept {
  const std::size_t at = idx(first) * idx(dof), size = idx(count) * idx(dof);
  return {count, dof, std::span(q).subspan(at, size), std::span(qdot).subspan(at, size),
          std::span(times_s).subspan(idx(first), idx(count))};
}

bool ChainCosts::reset(const Problem& problem, const std::optional<BodyChain::Base>& body) {
  problem_ = &problem;
  const bool is_resized = dof_ != problem.robot->description().dof() ||
                          checks_ != problem.interpolated_checks ||
                          intervals_ != problem.support_states - 1;
  const auto apart = body ? std::span<const int>(*body) : std::span<const int>();
  bool is_other_prior = prior_.reset(problem.qc, problem.dt_s, apart);
  const bool is_same_body =
      body ? body_ && body_->is_of(*body, problem.qc, problem.dt_s) : !body_.has_value();
  if (!is_same_body) {
    is_other_prior = true;
    body_.reset();
    if (body) body_.emplace(*body, problem.qc, problem.dt_s);
  }
  if (!is_resized && !is_other_prior) return false;
  dof_ = problem.robot->description().dof();
  checks_ = problem.interpolated_checks;
  intervals_ = problem.support_states - 1;
  const GpPrior prior({}, problem.dt_s);  // interpolation is the same for every joint
  interpolations_.clear();
  for (int k = 1; k <= checks_; ++k) {
    interpolations_.push_back(prior.interpolation(k / (checks_ + 1.0)));
  }
  support_.resize(states(), dof_, problem.dt_s);
  all_.resize(intervals_ * (checks_ + 1) + 1, dof_, problem.dt_s / (checks_ + 1));
  ends_.assign_zeros(4 * padded(idx(dof_)));
  return true;
}

void ChainCosts::resize(ChainEvaluation& evaluation) const {
  evaluation.support.resize(idx(states()) * 2 * idx(dof_));
  evaluation.normals.resize(static_cast<int>(all_.times_s.size()), dof_);
  evaluation.terms.resize(problem_->terms.size() + 1);
}

void ChainCosts::evaluate(ChainEvaluation& evaluation, double normals_wanted_below) {
  interpolate(evaluation.support);
  evaluation.normals.clear();
  evaluation.terms[0] = prior_.cost(evaluation.support);
  for (int i = 0; body_ && i < intervals_; ++i) {
    const double* const a = evaluation.support.data() + idx(i) * 2 * idx(dof_);
    evaluation.terms[0] += body_->cost(a, a + 2 * dof_);
  }
  evaluation.cost = evaluation.terms[0];
  for (std::size_t t = 0; t < problem_->terms.size(); ++t) {
    evaluation.normals.want_rows_below(normals_wanted_below - evaluation.cost);
    evaluation.terms[t + 1] = add_term(problem_->terms[t], evaluation.normals);
    evaluation.cost += evaluation.terms[t + 1];
  }
  evaluation.normals.want_rows_below(std::numeric_limits<double>::infinity());
  evaluation.has_normals = !(evaluation.cost > normals_wanted_below);
}

double ChainCosts::add_term(const CostTerm& term, StateNormals& normals) {
  const std::size_t step = idx(checks_ + 1);
  const StateCost& cost = *term.cost;
  switch (term.placement) {
    case Placement::kStart: return add_at(0, term, normals);
    case Placement::kGoal: return add_at(intervals_, term, normals);
    case Placement::kSupport:
      return cost.linearise(support_.batch(0, states(), dof_), {0, step}, normals, scratch_);
    case Placement::kSupportAndInterpolated: break;
  }
  const int all = static_cast<int>(all_.times_s.size());
  return cost.linearise(all_.batch(0, all, dof_), {0, 1}, normals, scratch_);
}

double ChainCosts::add_at(int support, const CostTerm& term, StateNormals& normals) {
  const std::size_t step = idx(checks_ + 1);
  return term.cost->linearise(support_.batch(support, 1, dof_), {idx(support) * step, step},
                              normals, scratch_);
}

void ChainCosts::evaluate_end(ChainEvaluation& evaluation, Placement end) {
  const int support = end == Placement::kStart ? 0 : intervals_;
  const Placement other = end == Placement::kStart ? Placement::kGoal : Placement::kStart;
  interpolate(evaluation.support);
  evaluation.normals.clear(idx(support) * idx(checks_ + 1));
  evaluation.cost = evaluation.terms[0];
  for (std::size_t t = 0; t < problem_->terms.size(); ++t) {
    const CostTerm& term = problem_->terms[t];
    double& cost = evaluation.terms[t + 1];
    if (term.placement != other) {
      const double here = add_at(support, term, evaluation.normals);
      if (term.placement == end) cost = here;  // what holds along the way costs what it did
    }
    evaluation.cost += cost;
  }
}

void ChainCosts::interpolate(std::span<const double> support) {
  const std::size_t d = idx(dof_);
  for (int i = 0; i <= intervals_; ++i) {
    const double* a = support.data() + idx(i) * 2 * d;
    const std::size_t first = idx(i) * idx(checks_ + 1);
    std::copy_n(a, d, support_.q.data() + idx(i) * d);
    std::copy_n(a + d, d, support_.qdot.data() + idx(i) * d);
    std::copy_n(a, d, all_.q.data() + first * d);
    std::copy_n(a + d, d, all_.qdot.data() + first * d);
    if (i == intervals_) break;
    for (std::size_t row = 0; row < 4; ++row) {
      std::copy_n(a + row * d, d, ends_.data() + row * padded(d));
    }
    for (std::size_t k = 0; k < interpolations_.size(); ++k) {
      // Lanes beyond the last joint fall on the next state, which is written later.
      interpolate_between(ends_.data(), padded(d), interpolations_[k],
                          all_.q.data() + (first + k + 1) * d,
                          all_.qdot.data() + (first + k + 1) * d);
      if (!body_) continue;
      body_->interpolate(a, a + 2 * d, interpolations_[k], all_.q.data() + (first + k + 1) * d,
                         all_.qdot.data() + (first + k + 1) * d);
    }
  }
}

void ChainCosts::prepare(ChainSystem& system) const {
  system.resize(states(), 2 * dof_);
  prior_.add_hessian(system);
  system.keep();
}

void ChainCosts::assemble(const ChainEvaluation& evaluation, ChainSystem& system) {
  prior_.add_rhs(system, evaluation.support);
  if (body_) body_->add_prior(system, evaluation.support);
  const std::size_t step = idx(checks_ + 1);
  for (int i = 0; i <= intervals_; ++i) {
    add_support_state(evaluation.normals, idx(i) * step, system, i);
    if (i == intervals_) break;
    if (body_) {
      body_->add_interval(evaluation.normals, idx(i) * step + 1, interpolations_,
                          evaluation.support, system, i);
    } else {
      add_interval(evaluation.normals, idx(i) * step + 1, interpolations_, system, i);
    }
  }
  if (body_) body_->turn_into_body(system, evaluation.support);
}

void ChainCosts::finish_step(std::span<const double> support,
                             std::span<double> moved) const noexcept {
  if (body_) body_->turn_into_world(support, moved);
}

}  // namespace sidestep
