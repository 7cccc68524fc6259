#include "space_time.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <queue>
#include <span>
#include <string>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>

#include "base_clearance.hpp"
#include "base_motion.hpp"

namespace sidestep {
namespace {

using detail::BaseClearance;
using detail::BaseLimits;
using detail::BaseState;
using detail::OtherJoints;
using detail::Stretch;
using Eigen::Vector2d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct SearchNode {
  BaseState state;
  int steps = 0;              ///< Of step_s since the start.
  double sure_until_s = 0.0;  ///< The robot is clear until then, whatever comes next.
  int parent = -1;
  int velocity = -1;  ///< Index among those that steps lead to; -1: the start's.
};

/// Of a base with a share of its speed, the same in all directions.
BaseLimits limits_of(const Problem& problem, std::array<int, 2> base) {
  BaseLimits limits{kInfinity, kInfinity};
  for (const int j : base) {
    const Joint& joint = problem.robot->description().joints[idx(j)];
    limits.speed_mps = std::min(limits.speed_mps, problem.speed_fraction * joint.max_velocity);
    limits.acceleration_mps2 = std::min(limits.acceleration_mps2, joint.max_acceleration);
  }
  constexpr double kRamp_s = 0.5;  // to full speed, where nothing is known
  if (!std::isfinite(limits.acceleration_mps2)) {
    limits.acceleration_mps2 = limits.speed_mps / kRamp_s;
  }
  return limits;
}

/// What moves: a base, and the other joints, which are as good as a part of time.
struct Mover {
  Mover(const SpaceTimeSettings& settings, const Problem& of, std::array<int, 2> joints)
      : problem(of),
        base(joints),
        limits(limits_of(of, joints)),
        others(of, joints),
        goal_m(of.goal.q[joints[0]], of.goal.q[joints[1]]),
        clearance(of, joints, others, settings.extra_margin_m, limits.speed_mps),
        last_metre_s(
            least_duration_s({goal_m + Vector2d::UnitX(), Vector2d::Zero()}, goal_m, limits)) {
    const double left_s = of.prediction ? of.prediction->end_s() - of.prediction_from_s : 0.0;
    const int instants = 1 + static_cast<int>(std::ceil(std::max(0.0, left_s) / kApart_s));
    arrivals_s.assign(idx(instants) + 1, kInfinity);
    for (int k = instants; k >= 0; --k) {
      const double time_s = k * kApart_s;
      if (clearance.is_clear(goal_m, std::max(time_s, others.duration_s()))) {
        arrivals_s[idx(k)] = time_s;
      } else if (k < instants) {
        arrivals_s[idx(k)] = arrivals_s[idx(k) + 1];
      }
    }
  }

  /// The first instant from then on at which the robot may be at its goal, as good as.
  [[nodiscard]] double arrival_s(double time_s) const {
    time_s = std::max(time_s, others.duration_s());
    const auto k = static_cast<std::size_t>(time_s / kApart_s);
    return std::max(time_s, arrivals_s[std::min(k, arrivals_s.size() - 1)]);
  }

  static constexpr double kApart_s = 0.1;
  const Problem& problem;
  std::array<int, 2> base;
  BaseLimits limits;
  OtherJoints others;
  Vector2d goal_m;
  BaseClearance clearance;
  /// How long before the goal it may be that somebody who stands there is waited for.
  double last_metre_s;
  std::vector<double> arrivals_s;  ///< When the goal is clear, from every kApart_s on.
};

class Search {
 public:
  Search(const SpaceTimeSettings& settings, double step_s, Mover& mover)
      : settings_(settings),
        mover_(mover),
        problem_(mover.problem),
        base_(mover.base),
        limits_(mover.limits),
        others_(mover.others),
        clearance_(mover.clearance),
        goal_m_(mover.goal_m),
        step_s_(step_s) {
    const Vector2d start_m(problem_.start.q[base_[0]], problem_.start.q[base_[1]]);
    const Vector2d way_m = goal_m_ - start_m;
    velocities_.push_back(Vector2d::Zero());
    for (const double speed : {0.5, 1.0}) {
      for (int k = 0; k < settings.directions; ++k) {
        const double angle =
            std::atan2(way_m.y(), way_m.x()) + 2.0 * std::numbers::pi * k / settings.directions;
        velocities_.push_back(speed * limits_.speed_mps *
                              Vector2d(std::cos(angle), std::sin(angle)));
      }
    }
    constexpr double kOfStep = 0.3;
    cell_m_ = std::min(settings.cell_m, kOfStep * step_s_ * limits_.speed_mps);
    if (problem_.prediction) {
      const double left_s = problem_.prediction->end_s() - problem_.prediction_from_s;
      last_layer_ = std::max(0, static_cast<int>(std::ceil(left_s / step_s_)));
    }
    nodes_.push_back({{start_m, {problem_.start.qdot[base_[0]], problem_.start.qdot[base_[1]]}}});
  }

  [[nodiscard]] Solution run(const Deadline& deadline) {
    open(0);
    while (!queue_.empty()) {
      if (static_cast<int>(nodes_.size()) > settings_.max_nodes) {
        return end(SolveStatus::kNoPath, "no free motion among max_nodes nodes");
      }
      if (deadline.expired()) return end(SolveStatus::kDeadline, "the time was up");
      const Candidate next = queue_.top();
      queue_.pop();
      if (next.velocity == kClosing) {
        if (closes(next.node)) return found(next.node);
      } else {
        expand(next.node, next.velocity);
      }
    }
    return end(SolveStatus::kNoPath, "every motion is blocked");
  }

 private:
  static constexpr int kClosing = -1;

  /// A step from a node to a velocity, or the straight way from it to the goal.
  struct Candidate {
    double bound_s = 0.0;    ///< When it may be at the goal; all the same where that is awaited.
    double unbound_s = 0.0;  ///< The same, whenever that is clear.
    int steps = 0;
    std::int64_t order = 0;
    int node = 0;
    int velocity = kClosing;

    /// Where the goal has to be waited for, depth first.
    [[nodiscard]] bool operator<(const Candidate& other) const noexcept {
      return std::tie(other.bound_s, steps, other.unbound_s, other.order) <
             std::tie(bound_s, other.steps, unbound_s, order);
    }
  };

  [[nodiscard]] double time_s(const SearchNode& node) const { return node.steps * step_s_; }

  /// The velocity changes as fast as may be, and then stays for the rest of the step.
  [[nodiscard]] std::array<Stretch, 2> step(const BaseState& from, int velocity) const {
    const Vector2d& v_mps = velocities_[idx(velocity)];
    const double turn_s =
        std::min(step_s_, (v_mps - from.v_mps).norm() / limits_.acceleration_mps2);
    const Vector2d turned_m = from.p_m + 0.5 * turn_s * (from.v_mps + v_mps);
    return {{{turn_s, {turned_m, v_mps}},
             {step_s_ - turn_s, {turned_m + (step_s_ - turn_s) * v_mps, v_mps}}}};
  }

  /// Puts the ways on from a node into the queue.
  void open(int index) {
    const SearchNode node = nodes_[idx(index)];
    push(time_s(node) + close(node.state, goal_m_, limits_).duration_s, index, kClosing);
    constexpr double kRounding = 1.001;
    for (int v = 0; v < static_cast<int>(velocities_.size()); ++v) {
      const double change_mps = (velocities_[idx(v)] - node.state.v_mps).norm();
      if (change_mps > limits_.acceleration_mps2 * step_s_ * kRounding) continue;
      const BaseState next = step(node.state, v)[1].end;
      if (visited_.contains(key_of(next.p_m, v, node.steps + 1))) continue;
      push(time_s(node) + step_s_ + settings_.greed * least_duration_s(next, goal_m_, limits_),
           index, v);
    }
  }
  void push(double unbound_s, int index, int velocity) {
    double bound_s = mover_.arrival_s(unbound_s);
    if (!std::isfinite(bound_s)) return;
    const bool is_closing = velocity == kClosing;
    if (bound_s > std::max(unbound_s, others_.duration_s())) {
      if (is_closing) return;  // it would come while the goal is not clear
      bound_s += mover_.last_metre_s;
    }
    const int steps = nodes_[idx(index)].steps + (is_closing ? 1 : 0);
    queue_.push({bound_s, unbound_s, steps, order_++, index, velocity});
  }

  void expand(int index, int velocity) {
    const SearchNode from = nodes_[idx(index)];
    const auto stretches = step(from.state, velocity);
    SearchNode next{stretches[1].end, from.steps + 1, from.sure_until_s, index, velocity};
    if (!visited_.insert(key_of(next.state.p_m, velocity, next.steps)).second) return;
    if (!passes(from, stretches, next.sure_until_s)) return;
    nodes_.push_back(next);
    open(static_cast<int>(nodes_.size()) - 1);
  }

  [[nodiscard]] bool passes(const SearchNode& from, std::span<const Stretch> stretches,
                            double& sure_until_s) {
    BaseState at = from.state;
    double begin_s = time_s(from);
    for (const Stretch& stretch : stretches) {
      if (!clearance_.passes(at, stretch, begin_s, sure_until_s)) return false;
      begin_s += stretch.duration_s;
      at = stretch.end;
    }
    return true;
  }

  [[nodiscard]] bool closes(int index) {
    const SearchNode& node = nodes_[idx(index)];
    double sure_until_s = node.sure_until_s;
    return passes(node, close(node.state, goal_m_, limits_).stretches, sure_until_s);
  }

  /// Of what counts as one. Once nothing is predicted any more, it is all the same when.
  [[nodiscard]] std::uint64_t key_of(const Vector2d& p_m, int velocity, int steps) const {
    const auto cell = [&](double x) {
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(x / cell_m_)) +
                                        (1 << 17)) &
             0x3ffff;
    };
    const auto layer = static_cast<std::uint64_t>(std::min(steps, last_layer_));
    return cell(p_m.x()) | cell(p_m.y()) << 18 | static_cast<std::uint64_t>(velocity) << 36 |
           layer << 48;
  }

  [[nodiscard]] Solution end(SolveStatus status, std::string reason) const {
    Solution solution;
    solution.status = status;
    solution.iterations = static_cast<int>(nodes_.size());
    solution.reason = std::move(reason);
    return solution;
  }

  [[nodiscard]] Solution found(int index) const {
    Solution solution = end(SolveStatus::kConverged, {});
    std::vector<int> way;
    for (int at = index; at >= 0; at = nodes_[idx(at)].parent) way.push_back(at);
    std::ranges::reverse(way);
    Trajectory& motion = solution.trajectory;
    motion.dof = problem_.robot->description().dof();
    write(nodes_.front().state, 0.0, motion);
    for (const int at : way) {
      const SearchNode& node = nodes_[idx(at)];
      if (node.parent < 0) continue;
      const SearchNode& before = nodes_[idx(node.parent)];
      write(before.state, step(before.state, node.velocity), time_s(before), motion);
    }
    const SearchNode& last = nodes_[idx(index)];
    write(last.state, close(last.state, goal_m_, limits_).stretches, time_s(last), motion);
    constexpr double kLeastMotion_s = 0.1;  // of a robot that is at its goal
    const double end_s = std::max(others_.duration_s(), motion.size() < 2 ? kLeastMotion_s : 0.0);
    if (end_s > motion.duration_s()) write({goal_m_, Vector2d::Zero()}, end_s, motion);
    solution.cost = motion.duration_s();
    return solution;
  }

  /// A state at the end of each stretch, and at that of the other joints' motion.
  void write(const BaseState& from, std::span<const Stretch> stretches, double begin_s,
             Trajectory& motion) const {
    BaseState at = from;
    for (const Stretch& stretch : stretches) {
      constexpr double kLeast_s = 1e-6;  // no state of its own
      if (stretch.duration_s < kLeast_s) continue;
      const double others_s = others_.duration_s() - begin_s;
      if (others_s > kLeast_s && others_s < stretch.duration_s - kLeast_s) {
        const double share = others_s / stretch.duration_s;
        write({place_on(at, stretch, others_s), at.v_mps + share * (stretch.end.v_mps - at.v_mps)},
              others_.duration_s(), motion);
      }
      begin_s += stretch.duration_s;
      at = stretch.end;
      write(at, begin_s, motion);
    }
  }
  void write(const BaseState& state, double time_s, Trajectory& motion) const {
    std::vector<double> q(idx(motion.dof)), qdot(idx(motion.dof));
    others_.sample(time_s, q, qdot);
    for (int axis : {0, 1}) {
      q[idx(base_[idx(axis)])] = state.p_m[axis];
      qdot[idx(base_[idx(axis)])] = state.v_mps[axis];
    }
    motion.times_s.push_back(time_s);
    motion.positions.insert(motion.positions.end(), q.begin(), q.end());
    motion.velocities.insert(motion.velocities.end(), qdot.begin(), qdot.end());
  }

  const SpaceTimeSettings& settings_;
  Mover& mover_;
  const Problem& problem_;
  std::array<int, 2> base_;
  BaseLimits limits_;
  const OtherJoints& others_;
  BaseClearance& clearance_;
  Vector2d goal_m_;
  double step_s_ = 0.0;
  double cell_m_ = 0.0;
  int last_layer_ = 0;  ///< Of those in which anything is predicted.
  std::vector<Vector2d> velocities_;
  std::vector<SearchNode> nodes_;
  std::priority_queue<Candidate> queue_;
  std::unordered_set<std::uint64_t> visited_;
  std::int64_t order_ = 0;
};

class SpaceTime final : public Optimiser {
 public:
  explicit SpaceTime(const SpaceTimeSettings& settings) : settings_(settings) {}

  Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                         const Deadline& deadline) override {
    SIDESTEP_TRY(problem.validate());
    SIDESTEP_TRY(check_initial(problem, initial));
    const auto base = problem.robot->description().planar_base();
    if (!base) {
      return invalid("space_time moves two prismatic joints, which the robot does not have");
    }
    const Stopwatch watch;
    Mover mover(settings_, problem, *base);
    if (!mover.clearance.carries_all()) {
      return invalid("space_time moves two prismatic joints that carry all of the robot");
    }
    // Long enough for half of the speed to be gained or lost.
    const double least_s = 0.5 * mover.limits.speed_mps / mover.limits.acceleration_mps2;
    double step_s = std::max(settings_.step_s, least_s);
    Solution solution = Search(settings_, step_s, mover).run(deadline);
    // What coarse steps do not find, finer ones may: out of a tight place or through a narrow one.
    for (int halving = 0; halving < 2 && 0.5 * step_s >= least_s; ++halving) {
      if (solution.status != SolveStatus::kNoPath) break;
      step_s *= 0.5;
      solution = Search(settings_, step_s, mover).run(deadline);
    }
    solution.solve_ms = watch.elapsed_ms();
    return solution;
  }

 private:
  SpaceTimeSettings settings_;
};

}  // namespace

std::unique_ptr<Optimiser> make_space_time(const SpaceTimeSettings& settings) {
  return std::make_unique<SpaceTime>(settings);
}

}  // namespace sidestep
