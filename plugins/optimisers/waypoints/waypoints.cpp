#include "waypoints.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/inverse_kinematics.hpp>
#include <sidestep/planning/validity_check.hpp>

namespace sidestep {
namespace {

std::span<const double> values(const Eigen::MatrixXd& matrix, int first, int count) {
  return {matrix.data() + matrix.rows() * first, idx(count) * idx(int(matrix.rows()))};
}

}  // namespace

WaypointStates::WaypointStates(const Problem& problem)
    : dof_(problem.robot->description().dof()),
      checks_(problem.interpolated_checks),
      waypoints_(problem.support_states),
      dt_s_(problem.dt_s),
      start_(problem.start),
      goal_(problem.goal) {
  for (int k = 1; k <= checks_; ++k) {
    const double s = k / (checks_ + 1.0);
    const double away = 1.0 - s;
    between_.push_back({{away * away * (1.0 + 2.0 * s), s * away * away * dt_s_,
                         s * s * (3.0 - 2.0 * s), -s * s * away * dt_s_},
                        {-6.0 * s * away / dt_s_, away * (1.0 - 3.0 * s), 6.0 * s * away / dt_s_,
                         s * (3.0 * s - 2.0)}});
  }
  support_q_.setZero(dof_, waypoints_);
  support_qdot_.setZero(dof_, waypoints_);
  all_q_.setZero(dof_, states());
  all_qdot_.setZero(dof_, states());
  for (int i = 0; i < waypoints_; ++i) support_times_s_.push_back(i * dt_s_);
  for (int s = 0; s < states(); ++s) all_times_s_.push_back(s * dt_s_ / step());
  find_shares();
}

/// By what update() does, with one joint and a unit at one waypoint after the other.
void WaypointStates::find_shares() {
  const int last = waypoints_ - 1;
  for (int s = 0; s < states(); ++s) {
    first_share_.push_back(shares_.size());
    const int i = std::min(s / step(), last);
    const int k = s % step();
    for (int w = std::max(0, i - 1); w <= std::min(last, i + (k == 0 ? 1 : 2)); ++w) {
      const auto velocity = [&](int at) {
        if (at == 0 || at == last) return 0.0;
        return (w == at + 1 ? 0.5 : w == at - 1 ? -0.5 : 0.0) / dt_s_;
      };
      Share share{w, w == i ? 1.0 : 0.0, velocity(i)};
      if (k > 0) {
        const auto& [q, qdot] = between_[idx(k - 1)];
        const std::array ends{w == i ? 1.0 : 0.0, velocity(i), w == i + 1 ? 1.0 : 0.0,
                              velocity(i + 1)};
        share.of_q = q[0] * ends[0] + q[1] * ends[1] + q[2] * ends[2] + q[3] * ends[3];
        share.of_qdot =
            qdot[0] * ends[0] + qdot[1] * ends[1] + qdot[2] * ends[2] + qdot[3] * ends[3];
      }
      if (share.of_q != 0.0 || share.of_qdot != 0.0) shares_.push_back(share);
    }
  }
  first_share_.push_back(shares_.size());
}

std::span<const WaypointStates::Share> WaypointStates::shares(int state) const noexcept {
  const std::size_t first = first_share_[idx(state)];
  return std::span(shares_).subspan(first, first_share_[idx(state) + 1] - first);
}

Waypoints WaypointStates::positions_of(const Trajectory& trajectory) const {
  Waypoints positions = Eigen::Map<const Waypoints>(trajectory.positions.data(), dof_, waypoints_);
  positions.col(0) = start_.q;
  positions.col(waypoints_ - 1) = goal_.q;
  return positions;
}

void WaypointStates::update(const Waypoints& positions) {
  support_q_ = positions;
  const int inner = waypoints_ - 2;
  support_qdot_.middleCols(1, inner) =
      (positions.rightCols(inner) - positions.leftCols(inner)) * (0.5 / dt_s_);
  support_qdot_.col(0) = start_.qdot;
  support_qdot_.col(waypoints_ - 1) = goal_.qdot;
  for (int i = 0; i < waypoints_; ++i) {
    all_q_.col(i * step()) = support_q_.col(i);
    all_qdot_.col(i * step()) = support_qdot_.col(i);
    if (i + 1 == waypoints_) break;
    for (int k = 1; k <= checks_; ++k) {
      const auto& [q, qdot] = between_[idx(k - 1)];
      all_q_.col(i * step() + k) = q[0] * support_q_.col(i) + q[1] * support_qdot_.col(i) +
                                   q[2] * support_q_.col(i + 1) + q[3] * support_qdot_.col(i + 1);
      all_qdot_.col(i * step() + k) = qdot[0] * support_q_.col(i) + qdot[1] * support_qdot_.col(i) +
                                      qdot[2] * support_q_.col(i + 1) +
                                      qdot[3] * support_qdot_.col(i + 1);
    }
  }
}

StateBatch WaypointStates::at_waypoints() const noexcept {
  return {waypoints_, dof_, values(support_q_, 0, waypoints_), values(support_qdot_, 0, waypoints_),
          support_times_s_};
}

StateBatch WaypointStates::everywhere() const noexcept {
  return {states(), dof_, values(all_q_, 0, states()), values(all_qdot_, 0, states()),
          all_times_s_};
}

StateBatch WaypointStates::at_waypoint(int i) const noexcept {
  return {1, dof_, values(support_q_, i, 1), values(support_qdot_, i, 1),
          std::span(support_times_s_).subspan(idx(i), 1)};
}

void WaypointStates::pull_back(const Eigen::MatrixXd& by_q, const Eigen::MatrixXd& by_qdot,
                               Waypoints& by_waypoint) const {
  for (int s = 0; s < states(); ++s) {
    for (const Share& share : shares(s)) {
      by_waypoint.col(share.waypoint) += share.of_q * by_q.col(s) + share.of_qdot * by_qdot.col(s);
    }
  }
}

Trajectory WaypointStates::trajectory() const {
  Trajectory out = make_trajectory(dof_, waypoints_, dt_s_);
  std::ranges::copy(at_waypoints().q, out.positions.begin());
  std::ranges::copy(at_waypoints().qdot, out.velocities.begin());
  return out;
}

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

namespace {

using Entries = std::vector<Eigen::Triplet<double>>;

/// d q / d tau between neighbours, tau running from 0 to 1; each row counts for one interval.
Entries velocity_rows(int waypoints) {
  const double per_unit = std::sqrt(waypoints - 1.0);
  Entries entries;
  for (int i = 0; i + 1 < waypoints; ++i) {
    entries.emplace_back(i, i, -per_unit);
    entries.emplace_back(i, i + 1, per_unit);
  }
  return entries;
}

/// d^2 q / d tau^2 at every waypoint; at the ends without what their velocities add.
Entries acceleration_rows(int waypoints) {
  const int last = waypoints - 1;
  const double per_unit = std::pow(last, 1.5);
  const double at_end = std::sqrt(2.0) * per_unit;  // half the weight of 2 (q_1 - q_0 - dt v_0)
  Entries entries{{0, 0, -at_end}, {0, 1, at_end}, {last, last, -at_end}, {last, last - 1, at_end}};
  for (int i = 1; i < last; ++i) {
    entries.emplace_back(i, i - 1, per_unit);
    entries.emplace_back(i, i, -2.0 * per_unit);
    entries.emplace_back(i, i + 1, per_unit);
  }
  return entries;
}

}  // namespace

Derivative derivative_of(std::string_view name) noexcept {
  return name == "velocity" ? Derivative::kVelocity : Derivative::kAcceleration;
}

DifferenceMetric::DifferenceMetric(const Problem& problem, Derivative derivative) {
  const int waypoints = problem.support_states, last = waypoints - 1;
  const bool of_acceleration = derivative == Derivative::kAcceleration;
  k_.resize(of_acceleration ? waypoints : last, waypoints);
  const Entries entries = of_acceleration ? acceleration_rows(waypoints) : velocity_rows(waypoints);
  k_.setFromTriplets(entries.begin(), entries.end());
  e_.setZero(problem.qc.size(), k_.rows());
  if (of_acceleration) {
    const double at_end = std::sqrt(2.0) * std::pow(last, 1.5) * problem.dt_s;
    e_.col(0) = -at_end * problem.start.qdot;
    e_.col(last) = at_end * problem.goal.qdot;
  }
  const Eigen::SparseMatrix<double> all = k_.transpose() * k_;
  a_ = all.block(1, 1, waypoints - 2, waypoints - 2);
  weights_ = problem.qc.maxCoeff() * problem.qc.cwiseInverse();
  factor_.compute(a_);
}

double DifferenceMetric::cost(const Waypoints& positions) const {
  const Eigen::MatrixXd rows = positions * k_.transpose() + e_;
  return 0.5 * weights_.dot(rows.rowwise().squaredNorm());
}

void DifferenceMetric::add_gradient(const Waypoints& positions, double weight,
                                    Waypoints& gradient) const {
  const Eigen::MatrixXd rows = positions * k_.transpose() + e_;
  gradient += (weight * weights_).asDiagonal() * (rows * k_);
}

Eigen::MatrixXd DifferenceMetric::solve(const Eigen::MatrixXd& x) const {
  const Eigen::MatrixXd solved = factor_.solve(x.transpose());
  return solved.transpose();
}

Eigen::MatrixXd DifferenceMetric::colour(const Eigen::MatrixXd& z) const {
  const Eigen::MatrixXd coloured = factor_.matrixU().solve(z.transpose());
  return coloured.transpose();
}

JointBounds::JointBounds(const Problem& problem, double margin)
    : lower(problem.qc.size()), upper(problem.qc.size()) {
  for (Eigen::Index j = 0; j < lower.size(); ++j) {
    const Joint& joint = problem.robot->description().joints[static_cast<std::size_t>(j)];
    const double inset = std::min(margin, 0.5 * (joint.upper - joint.lower));
    const auto [low, high] = std::minmax(problem.start.q[j], problem.goal.q[j]);
    lower[j] = std::max(joint.lower, std::min(joint.lower + inset, low));
    upper[j] = std::min(joint.upper, std::max(joint.upper - inset, high));
  }
}

bool JointBounds::contain(const Waypoints& positions) const {
  return ((positions.colwise() - lower).array() >= 0.0).all() &&
         ((positions.colwise() - upper).array() <= 0.0).all();
}

void keep_within(const JointBounds& bounds, const DifferenceMetric& metric, Waypoints& positions) {
  auto inner = positions.middleCols(1, metric.inner());
  for (int round = 0; round < metric.inner(); ++round) {
    const Eigen::MatrixXd low = inner.colwise() - bounds.lower;
    const Eigen::MatrixXd high = inner.colwise() - bounds.upper;
    const Eigen::MatrixXd beyond = low.cwiseMin(0.0) + high.cwiseMax(0.0);
    if (beyond.isZero(1e-12) || !beyond.allFinite()) break;
    const Eigen::MatrixXd spread = metric.solve(beyond);
    for (Eigen::Index j = 0; j < inner.rows(); ++j) {
      Eigen::Index worst = 0;
      if (beyond.row(j).cwiseAbs().maxCoeff(&worst) <= 0.0) continue;
      // A^-1 is positive on the diagonal, but neighbours pull the other way where a joint breaks
      // both of its limits.
      const double scale = beyond(j, worst) / spread(j, worst);
      if (std::isfinite(scale) && scale > 0.0) inner.row(j) -= scale * spread.row(j);
    }
  }
  inner = inner.cwiseMax(bounds.lower.replicate(1, inner.cols()))
              .cwiseMin(bounds.upper.replicate(1, inner.cols()));
}

namespace {

/// Takes over the costs of all terms; false, with the reason, if one is not a finite number.
bool account(std::vector<TermCost> terms, Solution& solution) {
  solution.terms = std::move(terms);
  solution.cost = 0.0;
  for (const TermCost& term : solution.terms) {
    solution.cost += term.cost;
    if (std::isfinite(term.cost) && std::isfinite(solution.cost)) continue;
    solution.status = SolveStatus::kFailed;
    solution.reason = "the cost of " + term.name + " is not a finite number";
    return false;
  }
  return true;
}

Solution without_trajectory(SolveStatus status, std::string reason) {
  Solution solution;
  solution.status = status;
  solution.reason = std::move(reason);
  return solution;
}

/// The same trajectory, led to another end: the further on a state is, the more it is moved.
Trajectory ending_in(Trajectory trajectory, const Eigen::VectorXd& q_end) {
  const int last = trajectory.size() - 1;
  for (Eigen::Index j = 0; j < q_end.size(); ++j) {
    const double off = q_end[j] - trajectory.q(last)[idx(j)];
    for (int i = 0; i <= last; ++i) trajectory.q(i)[idx(j)] += off * i / last;
  }
  return trajectory;
}

class WaypointOptimiser final : public Optimiser {
 public:
  explicit WaypointOptimiser(WaypointMethod method) : method_(std::move(method)) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    const Stopwatch watch;
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    Solution solution = is_goal_free(problem)
                            ? solve_for_a_configuration(problem, initial, deadline)
                            : solve_between_ends(problem, initial, deadline);
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  /// Of a goal that is left to costs: for the end of the guess or the configuration that guesses
  /// head for, if that reaches it, else for the one that is found to reach it soonest.
  [[nodiscard]] Solution solve_for_a_configuration(Problem problem, const Trajectory& initial,
                                                   const Deadline& deadline) const {
    const auto blocked = [&](std::span<const double> q) -> std::string {
      if (!problem.field) return "";
      const auto violation = state_violation(problem.robot, problem.field, problem.space,
                                             problem.collision_margin_m, q);
      return violation ? "is not valid: " + violation->what() : "";
    };
    const auto suits = [&](std::span<const double> q) {
      return goal_miss(problem, q).empty() && blocked(q).empty();
    };
    const std::span<const double> end = initial.q(initial.size() - 1);
    if (suits(end)) {
      std::ranges::copy(end, problem.goal.q.begin());
    } else if (!suits(as_span(problem.goal.q))) {
      GoalConfigurations goals = find_goals(problem, {}, 0, blocked, deadline);
      if (goals.q.empty()) {
        return without_trajectory(
            deadline.expired() ? SolveStatus::kDeadline : SolveStatus::kNoPath,
            std::move(goals.reason));
      }
      problem.goal.q = std::move(goals.q.front());
    }
    return solve_between_ends(problem, ending_in(initial, problem.goal.q), deadline);
  }

  [[nodiscard]] Solution solve_between_ends(const Problem& problem, const Trajectory& initial,
                                            const Deadline& deadline) const {
    const DifferenceMetric metric(problem, method_.smoothness);
    if (!metric.is_usable()) {
      return without_trajectory(SolveStatus::kFailed,
                                "the smoothness metric of " +
                                    std::to_string(problem.support_states) +
                                    " states is singular in double precision");
    }
    return find(problem, initial, deadline, metric);
  }

  [[nodiscard]] Solution find(const Problem& problem, const Trajectory& initial,
                              const Deadline& deadline, const DifferenceMetric& metric) const {
    WaypointStates states(problem);
    const Waypoints guess = states.positions_of(initial);
    states.update(guess);
    Solution solution;
    solution.status = SolveStatus::kConverged;
    const bool is_finite = account(term_costs(problem, states), solution);
    solution.initial_cost = solution.cost;
    if (!is_finite) return solution;
    const auto search = method_.search(problem, metric);
    if (!search->begin(guess)) {
      return without_trajectory(SolveStatus::kFailed,
                                "the objective of the initial trajectory is not a finite number");
    }
    const SearchEnd end = search->run(deadline);
    if (end.status == SolveStatus::kFailed) {
      return without_trajectory(SolveStatus::kFailed, end.reason);
    }
    solution.status = end.status;
    solution.iterations = end.iterations;
    solution.accepted_iterations = end.accepted;
    std::vector<TermCost> of_initial = std::move(solution.terms);
    states.update(search->best());
    if (!account(term_costs(problem, states), solution)) return solution;
    if (end.status == SolveStatus::kDeadline) {
      solution.reason =
          (deadline.stop_requested() ? "stopped on request after " : "the deadline passed after ") +
          std::to_string(end.iterations) + " iterations";
      if (solution.cost > solution.initial_cost) {
        states.update(guess);
        account(std::move(of_initial), solution);
      }
    } else if (end.status == SolveStatus::kIterationLimit) {
      solution.reason =
          end.reason.empty()
              ? iteration_limit_reason(method_.max_iterations, end.last_decrease, end.objective)
              : end.reason;
    }
    solution.trajectory = states.trajectory();
    return solution;
  }

  WaypointMethod method_;
};

}  // namespace

std::unique_ptr<Optimiser> make_waypoint_optimiser(WaypointMethod method) {
  return std::make_unique<WaypointOptimiser>(std::move(method));
}

}  // namespace sidestep
