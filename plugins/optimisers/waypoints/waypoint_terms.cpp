#include "waypoint_terms.hpp"

#include <algorithm>
#include <string>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// The states that a term applies to, and where they lie among all.
struct Felt {
  StateBatch batch;
  StateRange range;
};

Felt felt_by(const CostTerm& term, const WaypointStates& states) {
  const std::size_t step = idx(states.step());
  const int last = states.waypoints() - 1;
  switch (term.placement) {
    case Placement::kStart: return {states.at_waypoint(0), {0, step}};
    case Placement::kGoal: return {states.at_waypoint(last), {idx(last) * step, step}};
    case Placement::kSupport: return {states.at_waypoints(), {0, step}};
    case Placement::kSupportAndInterpolated: break;
  }
  return {states.everywhere(), {0, 1}};
}

/// Twice the cost of a term at each state that feels it, as visit(state, sum of squares).
void visit_squares(const CostTerm& term, const WaypointStates& states, Scratch& scratch,
                   const auto& visit) {
  const auto [batch, range] = felt_by(term, states);
  const std::size_t rows = idx(term.cost->residual_count());
  Scratch::Scope scope(scratch);
  const auto residuals = scope.doubles(rows * idx(batch.count));
  term.cost->evaluate(batch, {residuals, {}, {}}, scratch);
  for (std::size_t i = 0; i < idx(batch.count); ++i) {
    double sum = 0.0;
    for (const double residual : residuals.subspan(i * rows, rows)) sum += residual * residual;
    visit(range[i], sum);
  }
}

/// 1/2 sum e^T Q(dt)^-1 e, e = Phi(dt) x_i - x_{i+1} (docs/numerics.md).
double gp_prior(const Problem& problem, const WaypointStates& states) {
  const StateBatch at = states.at_waypoints();
  const std::size_t dof = idx(at.dof);
  const double dt = problem.dt_s;
  double sum = 0.0;
  for (std::size_t i = 0; i + dof < at.q.size(); ++i) {
    const double e_q = at.q[i] + dt * at.qdot[i] - at.q[i + dof];
    const double e_qdot = at.qdot[i] - at.qdot[i + dof];
    sum += (12.0 * (e_q / dt) * (e_q / dt) - 12.0 * (e_q / dt) * e_qdot + 4.0 * e_qdot * e_qdot) /
           (dt * problem.qc[static_cast<Eigen::Index>(i % dof)]);
  }
  return 0.5 * sum;
}

}  // namespace

WaypointTerms::WaypointTerms(const Problem& problem, std::vector<std::string_view> left_out)
    : problem_(&problem) {
  for (const CostTerm& term : problem_->terms) {
    if (!std::ranges::count(left_out, term.cost->name())) terms_.push_back(&term);
  }
}

double WaypointTerms::linearise(const WaypointStates& states, StateNormals& normals) {
  normals.resize(states.states(), states.dof());
  normals.clear();
  double cost = 0.0;
  for (const CostTerm* term : terms_) {
    const auto [batch, range] = felt_by(*term, states);
    cost += term->cost->linearise(batch, range, normals, scratch_);
  }
  return cost;
}

double WaypointTerms::add_gradient(const WaypointStates& states, Waypoints& gradient) {
  const double cost = linearise(states, normals_);
  const int d = states.dof();
  by_q_.setZero(d, states.states());
  by_qdot_.setZero(d, states.states());
  using Vector = Eigen::Map<const Eigen::VectorXd>;
  for (int s = 0; s < states.states(); ++s) {
    if (normals_.has_position(idx(s))) {
      by_q_.col(s) += Vector(normals_.position(idx(s)).gradient, d);
    }
    if (normals_.has_full(idx(s))) {
      by_q_.col(s) += Vector(normals_.full(idx(s)).gradient, d);
      by_qdot_.col(s) += Vector(normals_.full(idx(s)).gradient + d, d);
    }
  }
  states.pull_back(by_q_, by_qdot_, gradient);
  return cost;
}

void WaypointTerms::add_costs(const WaypointStates& states, std::vector<double>& costs) {
  for (const CostTerm* term : terms_) {
    visit_squares(*term, states, scratch_,
                  [&](std::size_t state, double squares) { costs[state] += 0.5 * squares; });
  }
}

std::vector<TermCost> term_costs(const Problem& problem, const WaypointStates& states) {
  std::vector<TermCost> costs{{"gp_prior", gp_prior(problem, states)}};
  Scratch scratch;
  for (const CostTerm& term : problem.terms) {
    double cost = 0.0;
    visit_squares(term, states, scratch,
                  [&](std::size_t, double squares) { cost += 0.5 * squares; });
    costs.push_back({std::string(term.cost->name()), cost});
  }
  return costs;
}

}  // namespace sidestep
