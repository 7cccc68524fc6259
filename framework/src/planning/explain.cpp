#include <sidestep/planning/explain.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

#include "clearance_prover.hpp"
#include "residual_groups.hpp"

namespace sidestep {
namespace {

constexpr double kLeastGradient = 1e-6;
constexpr std::size_t kMost = 8;
constexpr int kStretches = 2;         // of one term and link or joint
constexpr double kFelt = 1e-16;       // cost of one state: less is rounding
constexpr double kLeastShare = 1e-3;  // of the cost; what is broken is told whatever it costs

/// States of a trajectory, row by row, with their times and their places in units of support
/// states.
struct StateRows {
  int dof;
  std::vector<double> q, qdot, times_s, place;

  [[nodiscard]] std::size_t size() const noexcept { return times_s.size(); }
  [[nodiscard]] StateBatch batch() const noexcept {
    return {static_cast<int>(size()), dof, q, qdot, times_s};
  }
  [[nodiscard]] std::span<const double> q_of(std::size_t state) const noexcept {
    const auto d = idx(dof);
    return std::span(q).subspan(state * d, d);
  }
  void add(std::span<const double> q_row, std::span<const double> qdot_row, double time_s,
           double at) {
    q.insert(q.end(), q_row.begin(), q_row.end());
    qdot.insert(qdot.end(), qdot_row.begin(), qdot_row.end());
    times_s.push_back(time_s);
    place.push_back(at);
  }
};

/// Knows what the residuals of a cost mean, where it is one of planning/costs.hpp or names them.
class HindranceReading {
 public:
  HindranceReading(const Problem& problem, const CostTerm& term)
      : problem_(problem),
        robot_(problem.robot->description()),
        meaning_(meaning_of(problem, *term.cost)),
        is_at_goal_(term.placement == Placement::kGoal) {
    if (meaning_ == Meaning::kNamed) {
      named_ = residual_groups(*term.cost);
      for (const ResidualGroup& group : named_) groups_.push_back(group.rows);
      return;
    }
    if (meaning_ == Meaning::kFloor) above_floor_ = spheres_above(*problem.space.floor, robot_);
    const auto link_of = [&](std::size_t sphere) { return idx(robot_.spheres[sphere].link); };
    std::map<std::size_t, std::vector<std::size_t>> groups;
    const auto dof = idx(robot_.dof());
    for (std::size_t row = 0; row < idx(term.cost->residual_count()); ++row) {
      std::size_t key = row;
      if (meaning_ == Meaning::kObstacle) key = link_of(row);
      if (meaning_ == Meaning::kFloor) key = link_of(idx(above_floor_[row]));
      if (meaning_ == Meaning::kStart || meaning_ == Meaning::kGoal) key = row % dof;
      groups[key].push_back(row);
    }
    for (auto& [key, rows] : groups) groups_.push_back(std::move(rows));
  }

  /// Residuals that are told of together: the spheres of a link, a pair of links, a joint.
  [[nodiscard]] const std::vector<std::vector<std::size_t>>& groups() const noexcept {
    return groups_;
  }
  /// Fills in kind, subject, other, amount, unit, obstacle and whether it is broken, from one
  /// residual, in `row`, of all of those of one state.
  void tell(const StateRows& rows, std::size_t state, std::size_t row,
            std::span<const double> residuals, Hindrance& out) const {
    const std::size_t at = state * idx(rows.dof) + row;
    switch (meaning_) {
      case Meaning::kObstacle: return tell_obstacle(rows.q_of(state), row, out);
      case Meaning::kFloor: return tell_floor(rows.q_of(state), idx(above_floor_[row]), out);
      case Meaning::kSelfCollision: return tell_self_collision(rows.q_of(state), row, out);
      case Meaning::kPositionLimit: return tell_position(rows.q[at], row, out);
      case Meaning::kVelocityLimit: return tell_velocity(rows.qdot[at], row, out);
      case Meaning::kStart:
      case Meaning::kGoal:
      case Meaning::kGoalVelocity: return tell_endpoint(rows, state, row, out);
      case Meaning::kNamed: return tell_named(row, residuals, out);
    }
  }

 private:
  enum class Meaning {
    kObstacle,
    kFloor,
    kSelfCollision,
    kPositionLimit,
    kVelocityLimit,
    kStart,
    kGoal,
    kGoalVelocity,
    kNamed
  };
  [[nodiscard]] static Meaning meaning_of(const Problem& problem, const StateCost& cost) {
    const RobotDescription& robot = problem.robot->description();
    const auto is = [&](std::string_view name, std::size_t residuals) {
      return cost.name() == name && idx(cost.residual_count()) == residuals;
    };
    if (problem.field && is("obstacle", robot.spheres.size())) return Meaning::kObstacle;
    const std::optional<Floor>& floor = problem.space.floor;
    if (floor && is("floor", spheres_above(*floor, robot).size())) return Meaning::kFloor;
    if (is("self_collision", robot.self_collision_pairs.size())) return Meaning::kSelfCollision;
    if (is("position_limit", robot.joints.size())) return Meaning::kPositionLimit;
    if (is("velocity_limit", robot.joints.size())) return Meaning::kVelocityLimit;
    const auto fits = [&](const RobotState& state) {
      return state.q.size() == robot.dof() && state.qdot.size() == robot.dof();
    };
    if (fits(problem.start) && is("start", 2 * robot.joints.size())) return Meaning::kStart;
    if (fits(problem.goal) && is("goal", 2 * robot.joints.size())) return Meaning::kGoal;
    if (fits(problem.goal) && is("goal_velocity", robot.joints.size()))
      return Meaning::kGoalVelocity;
    return Meaning::kNamed;
  }

  [[nodiscard]] std::vector<Eigen::Vector3d> centres_at(std::span<const double> q) const {
    Scratch scratch;
    std::vector<Eigen::Vector3d> centres_m(robot_.spheres.size());
    problem_.robot->sphere_centres(q, centres_m, scratch);
    return centres_m;
  }

  static void put(Hindrance::Kind kind, std::string subject, std::string other, double amount,
                  std::string unit, double tolerance, Hindrance& out) {
    out.kind = kind;
    out.subject = std::move(subject);
    out.other = std::move(other);
    out.amount = amount;
    out.unit = std::move(unit);
    out.broken = !(amount <= tolerance);
  }

  void tell_obstacle(std::span<const double> q, std::size_t sphere, Hindrance& out) const {
    const Eigen::Vector3d centre_m = centres_at(q)[sphere];
    double distance_m = 0.0;
    Eigen::Vector3d gradient;
    FieldStatus status = FieldStatus::kKnown;
    query_with_policy(*problem_.field, problem_.space, {&centre_m, 1}, {&distance_m, 1},
                      {&gradient, 1}, {&status, 1});
    const CollisionSphere& of = robot_.spheres[sphere];
    put(Hindrance::Kind::kCollision, robot_.links[idx(of.link)].name,
        obstacle_name(status, problem_.space), of.radius_m - distance_m, "m", 0.0, out);
    // Where unknown space begins, the field does not tell.
    if (status == FieldStatus::kUnknown && out.other != kObstacle) return;
    const double steepness = gradient.norm();
    if (std::isfinite(distance_m) && steepness > kLeastGradient) {
      out.obstacle_m = centre_m - distance_m / steepness * gradient;
    }
  }

  void tell_floor(std::span<const double> q, std::size_t sphere, Hindrance& out) const {
    const Eigen::Vector3d centre_m = centres_at(q)[sphere];
    put(Hindrance::Kind::kCollision, robot_.links[idx(robot_.spheres[sphere].link)].name,
        kFloorName, -FloorClearance(problem_.space, robot_)(sphere, centre_m), "m", 0.0, out);
    out.obstacle_m = {centre_m.x(), centre_m.y(), problem_.space.floor->height_m};
  }

  void tell_self_collision(std::span<const double> q, std::size_t pair, Hindrance& out) const {
    const auto centres_m = centres_at(q);
    const auto [first, second] = robot_.self_collision_pairs[pair];
    double closest_m = kInfinity;
    for (std::size_t a = 0; a < centres_m.size(); ++a) {
      for (std::size_t b = 0; b < centres_m.size(); ++b) {
        if (robot_.spheres[a].link != first || robot_.spheres[b].link != second) continue;
        const double radii_m = robot_.spheres[a].radius_m + robot_.spheres[b].radius_m;
        closest_m = std::min(closest_m, (centres_m[a] - centres_m[b]).norm() - radii_m);
      }
    }
    put(Hindrance::Kind::kSelfCollision, robot_.links[idx(second)].name,
        robot_.links[idx(first)].name, -closest_m, "m", 0.0, out);
  }

  void tell_position(double q, std::size_t joint, Hindrance& out) const {
    const Joint& of = robot_.joints[joint];
    const bool is_low = of.lower - q > q - of.upper;
    const std::string limit =
        limit_name(of, is_low ? "lower limit" : "upper limit", is_low ? of.lower : of.upper, "");
    put(Hindrance::Kind::kLimit, of.name, limit, is_low ? of.lower - q : q - of.upper, of.unit(),
        kLimitTolerance, out);
  }

  void tell_velocity(double qdot, std::size_t joint, Hindrance& out) const {
    const Joint& of = robot_.joints[joint];
    const double allowed = problem_.speed_fraction * of.max_velocity;
    put(Hindrance::Kind::kLimit, of.name, limit_name(of, "velocity limit", allowed, "/s"),
        std::abs(qdot) - allowed, of.unit() + std::string("/s"), kLimitTolerance, out);
  }

  void tell_endpoint(const StateRows& rows, std::size_t state, std::size_t row,
                     Hindrance& out) const {
    const std::size_t dof = idx(rows.dof), joint = row % dof, at = state * dof + joint;
    const bool is_start = meaning_ == Meaning::kStart;
    const RobotState& wanted = is_start ? problem_.start : problem_.goal;
    const bool velocity = row >= dof || meaning_ == Meaning::kGoalVelocity;
    const double off = velocity ? rows.qdot[at] - wanted.qdot[joint] : rows.q[at] - wanted.q[joint];
    put(Hindrance::Kind::kEndpoint, robot_.joints[joint].name, is_start ? "the start" : "the goal",
        std::abs(off), robot_.joints[joint].unit() + std::string(velocity ? "/s" : ""),
        kGoalTolerance, out);
  }

  void tell_named(std::size_t row, std::span<const double> residuals, Hindrance& out) const {
    const auto group = std::ranges::find_if(named_, [&](const ResidualGroup& candidate) {
      return std::ranges::find(candidate.rows, row) != candidate.rows.end();
    });
    const auto component = std::ranges::find(group->rows, row) - group->rows.begin();
    const ResidualName& name = group->names[idx(component)];
    const double length = group->length(residuals);
    out.kind = is_at_goal_ ? Hindrance::Kind::kEndpoint : Hindrance::Kind::kOther;
    out.subject = name.quantity + (name.component.empty() ? "" : " " + name.component);
    out.other = name.target;
    out.amount = name.sigma * (name.component.empty() ? length : std::abs(residuals[row]));
    out.unit = name.unit;
    out.broken = is_at_goal_ && !(length <= kGoalToleranceSigmas);
  }

  const Problem& problem_;
  const RobotDescription& robot_;
  Meaning meaning_;
  bool is_at_goal_;
  std::vector<std::vector<std::size_t>> groups_;
  std::vector<int> above_floor_;      ///< Spheres of kFloor's residuals.
  std::vector<ResidualGroup> named_;  ///< Of kNamed, as groups_.
};
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
  std::vector<double> q(idx(trajectory.dof)), qdot = q;
  for (int i = 0; i <= last; ++i) {
    add_support(i);
    for (int k = 1; i < last && k <= between; ++k) {
      const double fraction = k / (between + 1.0);
      const double from_s = trajectory.times_s[idx(i)];
      const double to_s = trajectory.times_s[idx(i) + 1];
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
  const auto m = idx(cost.residual_count());
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
    const double dt_s = trajectory.times_s[idx(i) + 1] - from_s;
    const GpPrior prior(problem.qc, dt_s);
    for (std::size_t j = 0; j < idx(trajectory.dof); ++j) {
      const Eigen::Vector2d error(
          trajectory.q(i)[j] + dt_s * trajectory.qdot(i)[j] - trajectory.q(i + 1)[j],
          trajectory.qdot(i)[j] - trajectory.qdot(i + 1)[j]);
      const double squared = (prior.whitening() * error).squaredNorm() / problem.qc[j];
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
  const auto weight = [](const Hindrance& h) { return std::isnan(h.cost) ? kInfinity : h.cost; };
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
