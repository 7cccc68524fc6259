#include <sidestep/planning/trajectory_objective.hpp>

#include <algorithm>
#include <string>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

namespace sidestep {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

/// What holds of one joint, of [q; qdot] of all of them.
MatrixXd for_all_joints(const Eigen::Matrix2d& one, const VectorXd& scales) {
  const Index d = scales.size();
  MatrixXd all = MatrixXd::Zero(2 * d, 2 * d);
  for (Index r = 0; r < 2; ++r) {
    for (Index c = 0; c < 2; ++c) all.block(r * d, c * d, d, d).diagonal() = one(r, c) * scales;
  }
  return all;
}

bool has_term_at(const Problem& problem, Placement placement) {
  return std::ranges::any_of(problem.terms,
                             [=](const CostTerm& term) { return term.placement == placement; });
}

}  // namespace

TrajectoryObjective::TrajectoryObjective(const Problem& problem)
    : problem_(problem),
      dof_(problem.robot->description().dof()),
      states_(problem.support_states),
      start_stays_(!has_term_at(problem, Placement::kStart)),
      goal_stays_(!has_term_at(problem, Placement::kGoal)) {
  const GpPrior prior(problem.qc, problem.dt_s);
  const VectorXd same = VectorXd::Ones(dof_);
  for (Index k = 0; k <= step(); ++k) {
    const auto [lambda, psi] =
        prior.interpolation(static_cast<double>(k) / static_cast<double>(step()));
    MatrixXd& weights = between_.emplace_back(2 * dof_, 4 * dof_);
    weights << for_all_joints(lambda, same), for_all_joints(psi, same);
  }
  Eigen::Matrix2d phi = Eigen::Matrix2d::Identity();
  phi(0, 1) = problem.dt_s;
  const VectorXd deviations = problem.qc.cwiseSqrt().cwiseInverse();
  prior_rows_.resize(2 * dof_, 4 * dof_);
  prior_rows_ << for_all_joints(prior.whitening() * phi, deviations),
      for_all_joints(-prior.whitening(), deviations);
}

Index TrajectoryObjective::interval_of(Index state) const noexcept {
  return std::min(state / step(), states_ - 2);
}

const MatrixXd& TrajectoryObjective::weights_of(Index state) const noexcept {
  return between_[idx(state - step() * interval_of(state))];
}

VectorXd TrajectoryObjective::variables_of(const Trajectory& trajectory) const {
  MatrixXd x(2 * dof_, states_);
  x << MatrixXd::Map(trajectory.positions.data(), dof_, states_),
      MatrixXd::Map(trajectory.velocities.data(), dof_, states_);
  if (start_stays_) x.col(0) << problem_.start.q, problem_.start.qdot;
  if (goal_stays_) x.col(states_ - 1) << problem_.goal.q, problem_.goal.qdot;
  return x.reshaped();
}

Trajectory TrajectoryObjective::trajectory_of(const VectorXd& x) const {
  Trajectory to = make_trajectory(static_cast<int>(dof_), static_cast<int>(states_), problem_.dt_s);
  const auto columns = x.reshaped(2 * dof_, states_);
  MatrixXd::Map(to.positions.data(), dof_, states_) = columns.topRows(dof_);
  MatrixXd::Map(to.velocities.data(), dof_, states_) = columns.bottomRows(dof_);
  return to;
}

MatrixXd TrajectoryObjective::everywhere(const VectorXd& x) const {
  MatrixXd all(2 * dof_, all_states());
  for (Index s = 0; s < all_states(); ++s) {
    all.col(s) = weights_of(s) * x.segment(2 * dof_ * interval_of(s), 4 * dof_);
  }
  return all;
}

StateBatch TrajectoryObjective::Seen::batch() const noexcept {
  return {static_cast<int>(q.cols()), static_cast<int>(q.rows()),
          std::span(q.data(), idx(q.size())), std::span(qdot.data(), idx(qdot.size())),
          as_span(times_s)};
}

TrajectoryObjective::Seen TrajectoryObjective::seen_by(const CostTerm& term,
                                                       const MatrixXd& all) const {
  const bool at_start = term.placement == Placement::kStart;
  const bool at_goal = term.placement == Placement::kGoal;
  const Index first = at_goal ? all.cols() - 1 : 0;
  const Index by = term.placement == Placement::kSupport ? step() : 1;
  const Index count = at_start || at_goal ? 1 : (all.cols() - 1) / by + 1;
  const auto columns = Eigen::seqN(first, count, by);
  Seen seen{{idx(first), idx(by)},
            all(Eigen::seqN(0, dof_), columns),
            all(Eigen::seqN(dof_, dof_), columns),
            VectorXd(count)};
  for (Index i = 0; i < count; ++i) {
    seen.times_s[i] =
        problem_.dt_s * static_cast<double>(first + i * by) / static_cast<double>(step());
  }
  return seen;
}

double TrajectoryObjective::prior_cost(const VectorXd& x) const {
  double squares = 0.0;
  for (Index i = 0; i + 1 < states_; ++i) {
    squares += (prior_rows_ * x.segment(2 * dof_ * i, 4 * dof_)).squaredNorm();
  }
  return 0.5 * squares;
}

std::vector<TermCost> TrajectoryObjective::costs(const VectorXd& x) {
  std::vector<TermCost> costs{{"gp_prior", prior_cost(x)}};
  const MatrixXd all = everywhere(x);
  for (const CostTerm& term : problem_.terms) {
    const Seen seen = seen_by(term, all);
    Scratch::Scope scope(scratch_);
    const auto residuals = scope.doubles(idx(term.cost->residual_count()) * idx(seen.q.cols()));
    term.cost->evaluate(seen.batch(), {residuals, {}, {}}, scratch_);
    double squares = 0.0;
    for (const double residual : residuals) squares += residual * residual;
    costs.push_back({std::string(term.cost->name()), 0.5 * squares});
  }
  return costs;
}

void TrajectoryObjective::add_states(std::vector<MatrixXd>& intervals, VectorXd& gradient) const {
  using Columns = Eigen::Map<const MatrixXd, 0, Eigen::OuterStride<>>;
  for (Index s = 0; s < all_states(); ++s) {
    const auto add = [&](const StateNormals::Block& block, Index width, std::size_t stride) {
      const auto rows = weights_of(s).topRows(width);
      const Columns of_state(block.hessian, width, width,
                             Eigen::OuterStride<>(static_cast<Index>(stride)));
      intervals[idx(interval_of(s))] += rows.transpose() * of_state * rows;
      gradient.segment(2 * dof_ * interval_of(s), 4 * dof_) +=
          rows.transpose() * VectorXd::Map(block.gradient, width);
    };
    const std::size_t i = idx(s);
    if (normals_.has_position(i)) add(normals_.position(i), dof_, normals_.position_stride());
    if (normals_.has_full(i)) add(normals_.full(i), 2 * dof_, normals_.full_stride());
  }
}

void TrajectoryObjective::hold_ends(Expansion& expansion) const {
  const auto stays = [&](Index variable) {
    return (start_stays_ && variable < 2 * dof_) || (goal_stays_ && variable >= size() - 2 * dof_);
  };
  for (Index v = 0; v < size(); ++v) {
    if (stays(v)) expansion.gradient[v] = 0.0;
    for (Eigen::SparseMatrix<double>::InnerIterator entry(expansion.hessian, v); entry; ++entry) {
      if (stays(entry.row()) || stays(v)) entry.valueRef() = entry.row() == v ? 1.0 : 0.0;
    }
  }
}

TrajectoryObjective::Expansion TrajectoryObjective::expand(const VectorXd& x) {
  Expansion out;
  out.terms.push_back({"gp_prior", prior_cost(x)});
  normals_.resize(static_cast<int>(all_states()), static_cast<int>(dof_));
  normals_.clear();
  const MatrixXd all = everywhere(x);
  for (const CostTerm& term : problem_.terms) {
    const Seen seen = seen_by(term, all);
    const double cost = term.cost->linearise(seen.batch(), seen.range, normals_, scratch_);
    out.terms.push_back({std::string(term.cost->name()), cost});
  }
  for (const TermCost& term : out.terms) out.cost += term.cost;

  const MatrixXd of_prior = prior_rows_.transpose() * prior_rows_;
  std::vector<MatrixXd> intervals(idx(states_ - 1), of_prior);
  out.gradient.setZero(size());
  for (Index i = 0; i + 1 < states_; ++i) {
    out.gradient.segment(2 * dof_ * i, 4 * dof_) += of_prior * x.segment(2 * dof_ * i, 4 * dof_);
  }
  add_states(intervals, out.gradient);

  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(intervals.size() * idx(of_prior.size()));
  for (Index i = 0; i + 1 < states_; ++i) {
    for (Index c = 0; c < of_prior.cols(); ++c) {
      for (Index r = 0; r < of_prior.rows(); ++r) {
        entries.emplace_back(static_cast<int>(2 * dof_ * i + r), static_cast<int>(2 * dof_ * i + c),
                             intervals[idx(i)](r, c));
      }
    }
  }
  out.hessian.resize(size(), size());
  out.hessian.setFromTriplets(entries.begin(), entries.end());
  hold_ends(out);
  return out;
}

}  // namespace sidestep
