#include <sidestep/core/index.hpp>
#include <sidestep/planning/explain.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

#include "hindrance_reading.hpp"

namespace sidestep {
namespace {

constexpr std::size_t kMost = 8;
constexpr int kStretches = 2;         // of one term and link or joint
constexpr double kFelt = 1e-16;       // cost of one state: less is rounding
constexpr double kLeastShare = 1e-3;  // of the cost; what is broken is told whatever it costs

/// The states at which a term of the given placement is felt, in order of time.
StateRows states_of(const Trajectory& trajectory, Placement placement, int checks) {
  StateRows rows{trajectory.dof, {}, {}, {}, {}};
  const int last = trajectory.size() - 1;
  const auto add_support = [&](int i) {
    rows.add(trajectory.q(i), trajectory.qdot(i), trajectory.times_s[idx(i)], i);
  };
  if (placement == Placement::kStart) add_support(0);
  if (placement == Placement::kGoal) add_support(last);
  if (placement == Placement::kStart || placement == Placement::kGoal) return rows;
  const int between = placement == Placement::kSupportAndInterpolated ? checks : 0;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof)), qdot = q;
  for (int i = 0; i <= last; ++i) {
    add_support(i);
    for (int k = 1; i < last && k <= between; ++k) {
      const double fraction = k / (between + 1.0);
      const double from_s = trajectory.times_s[idx(i)];
      const double to_s = trajectory.times_s[static_cast<std::size_t>(i) + 1];
      const double time_s = from_s + fraction * (to_s - from_s);
      trajectory.sample(time_s, q, qdot);
      rows.add(q, qdot, time_s, i + fraction);
    }
  }
  return rows;
}

void set_stretch(const StateRows& rows, std::size_t begin, std::size_t end, Hindrance& hindrance) {
  hindrance.first_state = static_cast<int>(std::floor(rows.place[begin]));
  hindrance.last_state = static_cast<int>(std::ceil(rows.place[end - 1]));
  hindrance.from_s = rows.times_s[begin];
  hindrance.to_s = rows.times_s[end - 1];
}

/// Appends what one term holds against some states, by group of residuals and stretch of
/// neighbouring states; returns the whole cost of the term.
double explain_term(const Problem& problem, const CostTerm& term, const StateRows& rows,
                    std::vector<Hindrance>& out) {
  const StateCost& cost = *term.cost;
  const auto m = static_cast<std::size_t>(cost.residual_count());
  const HindranceReading reading(problem, term);
  std::vector<double> residuals(rows.size() * m);
  Scratch scratch;
  cost.evaluate(rows.batch(), {residuals, {}, {}}, scratch);
  double sum = 0.0;
  for (const double residual : residuals) sum += 0.5 * residual * residual;

  for (const std::vector<std::size_t>& group : reading.groups()) {
    const auto cost_at = [&](std::size_t state) {
      double at = 0.0;
      for (const std::size_t row : group) {
        at += 0.5 * residuals[state * m + row] * residuals[state * m + row];
      }
      return at;
    };
    for (std::size_t begin = 0, end = 0; begin < rows.size(); begin = end) {
      Hindrance hindrance;
      std::size_t worst_state = begin, worst_row = group.front();
      double worst = -1.0;
      for (; end < rows.size() && !(cost_at(end) <= kFelt); ++end) {  // not a number is felt, too
        hindrance.cost += cost_at(end);
        for (const std::size_t row : group) {
          const double size = std::abs(residuals[end * m + row]);
          if (size <= worst) continue;
          worst = size, worst_state = end, worst_row = row;
        }
      }
      if (end == begin) {
        ++end;
        continue;
      }
      hindrance.term = cost.name();
      hindrance.worst_s = rows.times_s[worst_state];
      set_stretch(rows, begin, end, hindrance);
      reading.tell(rows, worst_state, worst_row, std::span(residuals).subspan(worst_state * m, m),
                   hindrance);
      out.push_back(std::move(hindrance));
    }
  }
  return sum;
}

/// Appends the joint and interval that the GP prior holds the most; returns its whole cost.
double explain_prior(const Problem& problem, const Trajectory& trajectory,
                     std::vector<Hindrance>& out) {
  if (problem.qc.size() != trajectory.dof || !(problem.qc.array() > 0.0).all()) return 0.0;
  Hindrance hindrance;
  double worst = 0.0;
  for (int i = 0; i + 1 < trajectory.size(); ++i) {
    const double from_s = trajectory.times_s[idx(i)];
    const double dt_s = trajectory.times_s[static_cast<std::size_t>(i) + 1] - from_s;
    const GpPrior prior(problem.qc, dt_s);
    for (std::size_t j = 0; j < static_cast<std::size_t>(trajectory.dof); ++j) {
      const Eigen::Vector2d error(
          trajectory.q(i)[j] + dt_s * trajectory.qdot(i)[j] - trajectory.q(i + 1)[j],
          trajectory.qdot(i)[j] - trajectory.qdot(i + 1)[j]);
      const double squared =
          (prior.whitening() * error).squaredNorm() / problem.qc[static_cast<Eigen::Index>(j)];
      hindrance.cost += 0.5 * squared;
      if (squared <= worst) continue;
      worst = squared;
      hindrance.subject = problem.robot->description().joints[j].name;
      hindrance.worst_s = from_s;
    }
  }
  if (hindrance.cost <= kFelt) return hindrance.cost;
  hindrance.term = "gp_prior";
  hindrance.other = "constant velocity";
  hindrance.amount = std::sqrt(worst);
  hindrance.unit = "sigma";
  hindrance.last_state = trajectory.size() - 1;
  hindrance.to_s = trajectory.duration_s();
  const double cost = hindrance.cost;
  out.push_back(std::move(hindrance));
  return cost;
}

/// What is broken first, collisions before limits, then by cost; only what matters.
void arrange(Explanation& explanation) {
  auto& all = explanation.hindrances;
  for (Hindrance& hindrance : all) {
    hindrance.share = explanation.cost > 0.0 ? hindrance.cost / explanation.cost : 0.0;
  }
  std::erase_if(all, [](const Hindrance& h) { return !h.broken && h.share < kLeastShare; });
  const auto weight = [](const Hindrance& h) {
    return std::isnan(h.cost) ? std::numeric_limits<double>::infinity() : h.cost;
  };
  std::ranges::stable_sort(all, [&](const Hindrance& a, const Hindrance& b) {
    if (a.broken != b.broken) return a.broken;
    if (a.broken && a.kind != b.kind) return a.kind < b.kind;
    return weight(a) > weight(b);
  });
  std::map<std::pair<std::string, std::string>, int> told;
  std::erase_if(all, [&](const Hindrance& h) { return ++told[{h.term, h.subject}] > kStretches; });
  if (all.size() > kMost) all.resize(kMost);
}

Result<void> check_robot(const Problem& problem, int dof) {
  if (problem.robot && problem.robot->description().dof() == dof) return {};
  return invalid("there is nothing to explain: the problem has " +
                 (problem.robot ? std::to_string(problem.robot->description().dof()) : "no robot") +
                 (problem.robot ? " joints, but the trajectory " + std::to_string(dof) : ""));
}

}  // namespace

std::string Hindrance::what() const {
  const std::string size = format("%.3g", std::abs(amount)) + " " + unit;
  std::string where;
  if (obstacle_m) {
    where = format(" at (%.2f, %.2f, %.2f) m", obstacle_m->x(), obstacle_m->y(), obstacle_m->z());
  }
  const bool clear = amount < 0.0;
  switch (kind) {
    case Kind::kCollision:
    case Kind::kSelfCollision:
      return subject + " is " + size +
             (clear                 ? " from "
              : other == kFloorName ? " below "
                                    : " inside ") +
             other + where;
    case Kind::kLimit: return subject + " is " + size + (clear ? " short of " : " beyond ") + other;
    case Kind::kEndpoint:
    case Kind::kOther: return subject + " is " + size + " off" + (other.empty() ? "" : " " + other);
  }
  return subject;
}

std::string Hindrance::describe() const {
  std::string when = format(", at %.2f s", worst_s);
  if (to_s > from_s) when += format(" (from %.2f to %.2f s", from_s, to_s);
  if (to_s > from_s) when += format(", states %d to %d)", first_state, last_state);
  const std::string percent = share < kLeastShare ? "under 0.1" : format("%.1f", 100.0 * share);
  return what() + when + ": " + percent + " % of the cost, as " + term;
}

Result<Explanation> explain(const Problem& problem, const Trajectory& trajectory) {
  SIDESTEP_TRY(check_robot(problem, trajectory.dof));
  SIDESTEP_TRY(trajectory.validate());
  Explanation explanation;
  for (const CostTerm& term : problem.terms) {
    if (!term.cost) continue;
    const StateRows rows = states_of(trajectory, term.placement, problem.interpolated_checks);
    explanation.cost += explain_term(problem, term, rows, explanation.hindrances);
  }
  explanation.cost += explain_prior(problem, trajectory, explanation.hindrances);
  arrange(explanation);
  return explanation;
}

Result<Explanation> explain_state(const Problem& problem, std::span<const double> q) {
  SIDESTEP_TRY(check_robot(problem, static_cast<int>(q.size())));
  const std::vector<double> at_rest(q.size());
  StateRows rows{static_cast<int>(q.size()), {}, {}, {}, {}};
  rows.add(q, at_rest, 0.0, 0.0);
  Explanation explanation;
  for (const CostTerm& term : problem.terms) {
    const bool everywhere =
        term.placement != Placement::kStart && term.placement != Placement::kGoal;
    if (!term.cost || !everywhere) continue;
    explanation.cost += explain_term(problem, term, rows, explanation.hindrances);
  }
  arrange(explanation);
  return explanation;
}

}  // namespace sidestep
