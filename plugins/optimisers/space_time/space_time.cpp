#include "space_time.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <optional>
#include <queue>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>

namespace sidestep {
namespace {

using Eigen::Vector2d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Where the base is, and how fast.
struct BaseState {
  Vector2d p_m = Vector2d::Zero();
  Vector2d v_mps = Vector2d::Zero();
};

/// A stretch of motion in which the velocity changes evenly.
struct Stretch {
  double duration_s = 0.0;
  BaseState end;
};

/// From one state straight to the goal: to rest where need be, onto the line, along it, and to
/// rest.
struct Closing {
  std::array<Stretch, 4> stretches;
  double duration_s = 0.0;
};

/// What the base may do, m/s and m/s^2.
struct BaseLimits {
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;
};

/// From a state onto the straight line to the goal at `speed_mps`, and to rest; nothing where the
/// goal is passed before.
std::optional<Closing> close_at(const BaseState& from, const Vector2d& goal_m, double speed_mps,
                                const BaseLimits& limits) {
  const double a_mps2 = limits.acceleration_mps2;
  Vector2d turned_m = from.p_m;
  Vector2d cruise_mps = Vector2d::Zero();
  double turn_s = 0.0;
  // The direction depends on where the turn ends, and the other way round.
  constexpr int kRounds = 12;
  for (int i = 0; i < kRounds; ++i) {
    const double left_m = (goal_m - turned_m).norm();
    if (!(left_m > 0.0)) return std::nullopt;
    cruise_mps = speed_mps / left_m * (goal_m - turned_m);
    turn_s = (cruise_mps - from.v_mps).norm() / a_mps2;
    turned_m = from.p_m + 0.5 * turn_s * (from.v_mps + cruise_mps);
  }
  const double left_m = (goal_m - turned_m).dot(cruise_mps) / speed_mps;
  const double stop_m = 0.5 * speed_mps * speed_mps / a_mps2;
  constexpr double kBeside = 1e-3;  // of the way to rest, by which the line may miss the goal
  const double miss_m = (goal_m - turned_m - left_m / speed_mps * cruise_mps).norm();
  if (left_m < stop_m || miss_m > kBeside * stop_m) return std::nullopt;
  const double cruise_s = (left_m - stop_m) / speed_mps, stop_s = speed_mps / a_mps2;
  return Closing{{{{0.0, from},
                   {turn_s, {turned_m, cruise_mps}},
                   {cruise_s, {turned_m + cruise_s * cruise_mps, cruise_mps}},
                   {stop_s, {goal_m, Vector2d::Zero()}}}},
                 turn_s + cruise_s + stop_s};
}

/// The fastest such way; where there is none, to rest first.
Closing close(const BaseState& from, const Vector2d& goal_m, const BaseLimits& limits) {
  if (auto closing = close_at(from, goal_m, limits.speed_mps, limits)) return *closing;
  std::optional<Closing> best;
  double low_mps = 0.0, high_mps = limits.speed_mps;
  constexpr int kHalvings = 10;
  for (int i = 0; i < kHalvings; ++i) {
    const double speed_mps = 0.5 * (low_mps + high_mps);
    auto closing = close_at(from, goal_m, speed_mps, limits);
    (closing ? low_mps : high_mps) = speed_mps;
    if (closing) best = closing;
  }
  if (best) return *best;
  const double a_mps2 = limits.acceleration_mps2;
  const double rest_s = from.v_mps.norm() / a_mps2;
  const BaseState rest{from.p_m + 0.5 * rest_s * from.v_mps, Vector2d::Zero()};
  const Vector2d way_m = goal_m - rest.p_m;
  const double length_m = way_m.norm();
  if (!(length_m > 0.0)) return Closing{{{{rest_s, rest}, {}, {}, {0.0, rest}}}, rest_s};
  const double speed_mps = std::min(limits.speed_mps, std::sqrt(a_mps2 * length_m));
  const Vector2d cruise_mps = speed_mps / length_m * way_m;
  const double ramp_s = speed_mps / a_mps2;
  const double cruise_s = length_m / speed_mps - ramp_s;
  const Vector2d turned_m = rest.p_m + 0.5 * ramp_s * cruise_mps;
  return Closing{{{{rest_s, rest},
                   {ramp_s, {turned_m, cruise_mps}},
                   {cruise_s, {turned_m + cruise_s * cruise_mps, cruise_mps}},
                   {ramp_s, {goal_m, Vector2d::Zero()}}}},
                 rest_s + 2.0 * ramp_s + cruise_s};
}

BaseState between(const BaseState& a, const BaseState& b, double duration_s, double t) {
  const double h = duration_s, s = t / h;
  // Cubic Hermite: of even acceleration where the ends are.
  const double h00 = (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s), h10 = s * (1.0 - s) * (1.0 - s);
  const double h01 = s * s * (3.0 - 2.0 * s), h11 = s * s * (s - 1.0);
  return {h00 * a.p_m + h * h10 * a.v_mps + h01 * b.p_m + h * h11 * b.v_mps, Vector2d::Zero()};
}

/// The other joints: one cubic each from start to goal.
class OtherJoints {
 public:
  OtherJoints(const Problem& problem, std::array<int, 2> base) : problem_(problem), base_(base) {
    const auto& joints = problem.robot->description().joints;
    for (int j = 0; j < static_cast<int>(joints.size()); ++j) {
      if (j == base[0] || j == base[1]) continue;
      const double way = std::abs(problem.goal.q[j] - problem.start.q[j]);
      const double moves = way + std::abs(problem.start.qdot[j]);
      if (moves == 0.0) continue;
      const double speed = problem.speed_fraction * joints[idx(j)].max_velocity;
      duration_s_ = std::max(duration_s_, 1.5 * way / speed);
      const double acceleration = joints[idx(j)].max_acceleration;
      if (!std::isfinite(acceleration) || !(acceleration > 0.0)) continue;
      duration_s_ = std::max({duration_s_, std::sqrt(6.0 * way / acceleration) * 1.05,
                              4.0 * std::abs(problem.start.qdot[j]) / acceleration});
    }
  }
  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }

  void sample(double t, std::span<double> q, std::span<double> qdot) const {
    for (int j = 0; j < static_cast<int>(q.size()); ++j) {
      if (j == base_[0] || j == base_[1]) continue;
      const double q0 = problem_.start.q[j], v0 = problem_.start.qdot[j], q1 = problem_.goal.q[j];
      double at = q1, speed = 0.0;
      if (t < duration_s_) {
        const double h = duration_s_, slope = (q1 - q0) / h;
        const double c2 = (3.0 * slope - 2.0 * v0) / h, c3 = (v0 - 2.0 * slope) / (h * h);
        at = q0 + t * (v0 + t * (c2 + t * c3));
        speed = v0 + t * (2.0 * c2 + 3.0 * t * c3);
      }
      q[idx(j)] = at;
      if (!qdot.empty()) qdot[idx(j)] = speed;
    }
  }

 private:
  const Problem& problem_;
  std::array<int, 2> base_;
  double duration_s_ = 0.0;
};

/// Whether the robot is clear while its base makes a stretch.
class StretchCheck {
 public:
  StretchCheck(const Problem& problem, std::array<int, 2> base, const OtherJoints& others,
               double margin_m, double speed_mps)
      : problem_(problem),
        base_(base),
        others_(others),
        margin_m_(margin_m),
        floor_(problem.space, problem.robot->description()),
        speed_mps_(speed_mps) {
    const std::size_t spheres = problem.robot->description().spheres.size();
    centres_m_.resize(spheres);
    distances_m_.resize(spheres);
    gradients_.resize(spheres);
    statuses_.resize(spheres);
    q_.resize(idx(problem.robot->description().dof()));
    own_m_ = std::min(problem.collision_margin_m + margin_m, static_m(problem_base(), 0.0));
    moving_m_ = std::min(problem.prediction_margin_m + margin_m, predicted_m(0.0));
  }

  [[nodiscard]] bool is_clear(const BaseState& from, const Stretch& stretch, double begin_s) {
    constexpr double kNear_m = 0.03;  // that robot and sets come nearer between two looks
    const double moving_mps =
        speed_mps_ + (problem_.prediction ? problem_.prediction->speed_mps() : 0.0);
    const int steps =
        std::max(1, static_cast<int>(std::ceil(stretch.duration_s * moving_mps / (2.0 * kNear_m))));
    for (int k = 1; k <= steps; ++k) {
      const double t = stretch.duration_s * k / steps;
      const Vector2d p_m =
          k == steps ? stretch.end.p_m : between(from, stretch.end, stretch.duration_s, t).p_m;
      if (static_m(p_m, begin_s + t) < own_m_) return false;
      if (predicted_m(begin_s + t) < moving_m_) return false;
    }
    return true;
  }

 private:
  [[nodiscard]] Vector2d problem_base() const {
    return {problem_.start.q[base_[0]], problem_.start.q[base_[1]]};
  }

  /// Leaves the spheres' centres there.
  double static_m(const Vector2d& p_m, double t) {
    const RobotDescription& robot = problem_.robot->description();
    others_.sample(t, q_, {});
    for (int axis : {0, 1}) q_[idx(base_[idx(axis)])] = p_m[axis];
    for (std::size_t j = 0; j < q_.size(); ++j) {
      if (q_[j] < robot.joints[j].lower || q_[j] > robot.joints[j].upper) return -kInfinity;
    }
    problem_.robot->sphere_centres(q_, centres_m_, scratch_);
    std::ranges::fill(distances_m_, kInfinity);
    if (problem_.field) {
      query_with_policy(*problem_.field, problem_.space, centres_m_, distances_m_, gradients_,
                        statuses_);
    }
    double least_m = kInfinity;
    for (std::size_t s = 0; s < centres_m_.size(); ++s) {
      least_m = std::min(
          {least_m, distances_m_[s] - robot.spheres[s].radius_m, floor_(s, centres_m_[s])});
    }
    return least_m;
  }

  /// Of the centres as they are.
  double predicted_m(double t) {
    if (!problem_.prediction) return kInfinity;
    const auto& spheres = problem_.robot->description().spheres;
    problem_.prediction->query(problem_.prediction_from_s + t, centres_m_, distances_m_, {});
    double least_m = kInfinity;
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      least_m = std::min(least_m, distances_m_[s] - spheres[s].radius_m);
    }
    return least_m;
  }

  const Problem& problem_;
  std::array<int, 2> base_;
  const OtherJoints& others_;
  double margin_m_;
  FloorClearance floor_;
  double speed_mps_;
  double own_m_ = 0.0;
  double moving_m_ = 0.0;
  std::vector<Eigen::Vector3d> centres_m_, gradients_;
  std::vector<double> distances_m_, q_;
  std::vector<FieldStatus> statuses_;
  Scratch scratch_;
};

struct SearchNode {
  BaseState state;
  double time_s = 0.0;
  int parent = -1;
  int velocity = -1;  ///< Index among those that steps lead to; -1: the start's.
};

class Search {
 public:
  Search(const SpaceTimeSettings& settings, const Problem& problem, std::array<int, 2> base)
      : settings_(settings),
        problem_(problem),
        base_(base),
        limits_(limits_of(problem, base)),
        others_(problem, base),
        check_(problem, base, others_, settings.extra_margin_m, limits_.speed_mps),
        goal_m_(problem.goal.q[base[0]], problem.goal.q[base[1]]) {
    velocities_.push_back(Vector2d::Zero());
    for (const double share : {0.5, 1.0}) {
      for (int k = 0; k < settings.directions; ++k) {
        const double angle = 2.0 * std::numbers::pi * k / settings.directions;
        velocities_.push_back(share * limits_.speed_mps *
                              Vector2d(std::cos(angle), std::sin(angle)));
      }
    }
    // Long enough for half of the speed to be gained or lost.
    step_s_ = std::max(settings.step_s, 0.5 * limits_.speed_mps / limits_.acceleration_mps2);
  }

  [[nodiscard]] Solution run(const Deadline& deadline) {
    Solution solution;
    nodes_.push_back({{{problem_.start.q[base_[0]], problem_.start.q[base_[1]]},
                       {problem_.start.qdot[base_[0]], problem_.start.qdot[base_[1]]}}});
    open(0);
    while (!queue_.empty()) {
      if (static_cast<int>(nodes_.size()) > settings_.max_nodes) {
        return end(SolveStatus::kNoPath, "no free motion among max_nodes nodes");
      }
      if (deadline.expired()) return end(SolveStatus::kDeadline, "the time was up");
      const Candidate next = queue_.top();
      queue_.pop();
      if (next.is_closing) {
        if (closes(next.node)) return found(next.node);
      } else {
        expand(next.node, next.velocity);
      }
    }
    return end(SolveStatus::kNoPath, "every motion is blocked");
  }

 private:
  /// A step from a node to a velocity, or the straight way from it to the goal.
  struct Candidate {
    double bound_s = 0.0;
    std::int64_t order = 0;
    int node = 0;
    int velocity = 0;
    bool is_closing = false;

    [[nodiscard]] bool operator<(const Candidate& other) const noexcept {
      return std::tie(other.bound_s, other.order) < std::tie(bound_s, order);
    }
  };

  static BaseLimits limits_of(const Problem& problem, std::array<int, 2> base) {
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

  /// What nodes are ordered by; without greed, the least time at which the goal is reached.
  [[nodiscard]] double bound_s(const SearchNode& node) const {
    const double left_s = close(node.state, goal_m_, limits_).duration_s;
    return std::max(node.time_s + settings_.greed * left_s, others_.duration_s());
  }

  [[nodiscard]] BaseState after_step(const BaseState& from, int velocity) const {
    const Vector2d& v_mps = velocities_[idx(velocity)];
    return {from.p_m + 0.5 * step_s_ * (from.v_mps + v_mps), v_mps};
  }

  /// Puts the ways on from a node into the queue.
  void open(int index) {
    const SearchNode node = nodes_[idx(index)];
    queue_.push({bound_s(node), order_++, index, 0, true});
    for (int v = 0; v < static_cast<int>(velocities_.size()); ++v) {
      const double change_mps = (velocities_[idx(v)] - node.state.v_mps).norm();
      if (change_mps > limits_.acceleration_mps2 * step_s_ * 1.001) continue;
      SearchNode next{after_step(node.state, v), node.time_s + step_s_, index, v};
      queue_.push({bound_s(next), order_++, index, v, false});
    }
  }

  void expand(int index, int velocity) {
    const SearchNode from = nodes_[idx(index)];
    const SearchNode next{after_step(from.state, velocity), from.time_s + step_s_, index, velocity};
    if (!visited_.insert(key_of(next)).second) return;
    if (!check_.is_clear(from.state, {step_s_, next.state}, from.time_s)) return;
    nodes_.push_back(next);
    open(static_cast<int>(nodes_.size()) - 1);
  }

  [[nodiscard]] std::uint64_t key_of(const SearchNode& node) const {
    const auto cell = [&](double x) {
      return static_cast<std::uint64_t>(
                 static_cast<std::int64_t>(std::floor(x / settings_.cell_m)) + (1 << 17)) &
             0x3ffff;
    };
    const auto layer = static_cast<std::uint64_t>(std::lround(node.time_s / step_s_));
    return cell(node.state.p_m.x()) | cell(node.state.p_m.y()) << 18 |
           static_cast<std::uint64_t>(node.velocity + 1) << 36 | layer << 48;
  }

  [[nodiscard]] bool closes(int index) {
    const SearchNode& node = nodes_[idx(index)];
    BaseState at = node.state;
    double time_s = node.time_s;
    for (const Stretch& stretch : close(node.state, goal_m_, limits_).stretches) {
      if (stretch.duration_s > 0.0 && !check_.is_clear(at, stretch, time_s)) return false;
      time_s += stretch.duration_s;
      at = stretch.end;
    }
    return true;
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
    for (const int at : way) write(nodes_[idx(at)].state, nodes_[idx(at)].time_s, motion);
    double time_s = nodes_[idx(index)].time_s;
    BaseState last = nodes_[idx(index)].state;
    for (const Stretch& stretch : close(last, goal_m_, limits_).stretches) {
      constexpr double kLeast_s = 1e-6;  // no state of its own
      if (stretch.duration_s < kLeast_s) continue;
      time_s += stretch.duration_s;
      write(stretch.end, time_s, motion);
    }
    last = {goal_m_, Vector2d::Zero()};
    constexpr double kLeastMotion_s = 0.1;  // of a robot that is at its goal
    const double end_s = std::max(others_.duration_s(), motion.size() < 2 ? kLeastMotion_s : 0.0);
    if (end_s > time_s) write(last, end_s, motion);
    solution.cost = motion.duration_s();
    return solution;
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
  const Problem& problem_;
  std::array<int, 2> base_;
  BaseLimits limits_;
  OtherJoints others_;
  StretchCheck check_;
  Vector2d goal_m_;
  double step_s_ = 0.0;
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
    std::array<int, 2> base{-1, -1};
    const auto& joints = problem.robot->description().joints;
    int found = 0;
    for (int j = 0; j < static_cast<int>(joints.size()) && found < 2; ++j) {
      if (joints[idx(j)].type == Joint::Type::kPrismatic) base[idx(found++)] = j;
    }
    if (found < 2) {
      return invalid("space_time moves two prismatic joints, and the robot has " +
                     std::to_string(found));
    }
    const Stopwatch watch;
    Solution solution = Search(settings_, problem, base).run(deadline);
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
