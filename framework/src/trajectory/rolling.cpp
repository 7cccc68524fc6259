#include <sidestep/trajectory/rolling.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Dense>

#include <sidestep/core/index.hpp>

#include "rolling_way.hpp"

namespace sidestep {

BaseSpeed base_speed(const RollingBase& base, std::span<const double> q,
                     std::span<const double> qdot) noexcept {
  const double sin = std::sin(q[idx(base.yaw)]), cos = std::cos(q[idx(base.yaw)]);
  const double x = qdot[idx(base.x)], y = qdot[idx(base.y)];
  return {cos * x + sin * y, cos * y - sin * x};
}

namespace {

/// The heading, the speed ahead and the way of a base through a trajectory's pieces.
class BaseWay {
 public:
  /// Its speed within pieces is that of the trajectory in their middle, too, or even.
  BaseWay(const RollingBase& base, const Trajectory& trajectory, bool is_even)
      : base_(base), trajectory_(trajectory) {
    std::vector<double> q(idx(trajectory.dof)), qdot(idx(trajectory.dof));
    for (int state = 0; state < trajectory.size(); ++state) {
      speeds_.push_back(base_speed(base, trajectory.q(state), trajectory.qdot(state)).ahead_mps);
      if (state == 0) continue;
      trajectory.sample(0.5 * (time_s(state - 1) + time_s(state)), q, qdot);
      middle_speeds_.push_back(is_even ? 0.5 * (speeds_[idx(state) - 1] + speeds_.back())
                                       : base_speed(base, q, qdot).ahead_mps);
    }
  }

  /// Its end, from the start, where the heading is changed by `turn` and the speed by `push` times
  /// a bump, with its derivatives by both. Calls with the number and the place of every state.
  struct End {
    Eigen::Vector2d at_m;
    Eigen::Matrix2d derivative = Eigen::Matrix2d::Zero();  ///< By turn, by push.
  };
  template <class Place>
  End follow(double turn, double push, Place&& place) const {
    End end{{trajectory_.q(0)[idx(base_.x)], trajectory_.q(0)[idx(base_.y)]}};
    place(0, end.at_m);
    for (int state = 0; state + 1 < trajectory_.size(); ++state) {
      add_piece(state, turn, push, end);
      place(state + 1, end.at_m);
    }
    return end;
  }

  [[nodiscard]] double time_s(int state) const { return trajectory_.times_s[idx(state)]; }
  [[nodiscard]] double speed(int state, double push) const {
    return speeds_[idx(state)] + push * bump(time_s(state));
  }
  /// Nothing at either end, nor is its slope.
  [[nodiscard]] double bump(double time) const {
    const double sine = std::sin(std::numbers::pi * time / trajectory_.duration_s());
    return sine * sine;
  }
  [[nodiscard]] double bump_slope(double time) const {
    const double rate = std::numbers::pi / trajectory_.duration_s();
    return rate * std::sin(2.0 * rate * time);
  }

 private:
  /// By Gauss and Legendre, three points: the error is of the sixth power of the turn.
  void add_piece(int state, double turn, double push, End& end) const {
    static constexpr std::pair<double, double> kPoints[] = {
        {0.1127016653792583, 5.0 / 18.0}, {0.5, 8.0 / 18.0}, {0.8872983346207417, 5.0 / 18.0}};
    const double h = time_s(state + 1) - time_s(state);
    const std::size_t yaw = idx(base_.yaw);
    const double a0 = trajectory_.q(state)[yaw], a1 = trajectory_.q(state + 1)[yaw];
    const double r0 = h * trajectory_.qdot(state)[yaw], r1 = h * trajectory_.qdot(state + 1)[yaw];
    const double v0 = speeds_[idx(state)], v1 = speeds_[idx(state) + 1];
    const double vm = middle_speeds_[idx(state)];
    for (const auto& [u, weight] : kPoints) {
      const double bumped = bump(time_s(state) + u * h);
      const double heading =
          a0 + u * (r0 + u * (3.0 * (a1 - a0) - 2.0 * r0 - r1 + u * (r0 + r1 - 2.0 * (a1 - a0)))) +
          turn * bumped;
      const double ahead =
          v0 + u * (4.0 * vm - 3.0 * v0 - v1 + u * (2.0 * (v0 + v1) - 4.0 * vm)) + push * bumped;
      const Eigen::Vector2d direction(std::cos(heading), std::sin(heading));
      end.at_m += weight * h * ahead * direction;
      end.derivative.col(0) +=
          weight * h * ahead * bumped * Eigen::Vector2d(-direction.y(), direction.x());
      end.derivative.col(1) += weight * h * bumped * direction;
    }
  }

  RollingBase base_;
  const Trajectory& trajectory_;
  std::vector<double> speeds_;         ///< At states.
  std::vector<double> middle_speeds_;  ///< Of pieces.
};

void write(const RollingBase& base, const BaseWay& way, double turn, double push,
           Trajectory& trajectory) {
  Trajectory rolled = trajectory;
  (void)way.follow(turn, push, [&](int state, const Eigen::Vector2d& at_m) {
    const double time_s = way.time_s(state);
    const bool rests =
        std::ranges::all_of(trajectory.qdot(state), [](double v) { return v == 0.0; });
    const auto q = rolled.q(state), qdot = rolled.qdot(state);
    q[idx(base.x)] = at_m.x();
    q[idx(base.y)] = at_m.y();
    q[idx(base.yaw)] += turn * way.bump(time_s);
    if (rests) return;  // for stops, exactly
    qdot[idx(base.yaw)] += turn * way.bump_slope(time_s);
    const double speed = way.speed(state, push);
    qdot[idx(base.x)] = speed * std::cos(q[idx(base.yaw)]);
    qdot[idx(base.y)] = speed * std::sin(q[idx(base.yaw)]);
  });
  trajectory = std::move(rolled);
}

/// A turn and a push with which the base ends where the trajectory does.
std::optional<Eigen::Vector2d> aim(const RollingBase& base, const BaseWay& way,
                                   const Trajectory& trajectory) {
  constexpr double kThere_m = 1e-12;
  constexpr int kMostSteps = 20;
  constexpr double kMostTurn_rad = 0.5;
  const auto goal = trajectory.q(trajectory.size() - 1);
  const Eigen::Vector2d goal_m(goal[idx(base.x)], goal[idx(base.y)]);
  const auto ignore = [](int, const Eigen::Vector2d&) {};
  Eigen::Vector2d change = Eigen::Vector2d::Zero();
  for (int round = 0; round < kMostSteps; ++round) {
    const BaseWay::End end = way.follow(change.x(), change.y(), ignore);
    const Eigen::Vector2d off_m = goal_m - end.at_m;
    if (off_m.norm() < kThere_m) return change;
    change += end.derivative.completeOrthogonalDecomposition().solve(off_m);
    if (!(std::abs(change.x()) < kMostTurn_rad && change.allFinite())) return std::nullopt;
  }
  return std::nullopt;
}

/// Into how many parts each piece has to be cut to keep to the tolerance; empty: all do.
std::vector<int> parts_to_roll(const RollingBase& base, const Trajectory& trajectory) {
  constexpr double kWanted_mps = 0.2 * kSlipTolerance_mps;
  std::vector<int> parts;
  bool is_any = false;
  std::vector<double> q(idx(trajectory.dof)), qdot(idx(trajectory.dof));
  for (int state = 0; state + 1 < trajectory.size(); ++state) {
    const double begin_s = trajectory.times_s[idx(state)];
    const double h = trajectory.times_s[idx(state) + 1] - begin_s;
    double slip_mps = 0.0;
    for (const double share : {0.2, 0.5, 0.8}) {
      trajectory.sample(begin_s + share * h, q, qdot);
      slip_mps = std::max(slip_mps, std::abs(base_speed(base, q, qdot).left_mps));
    }
    // It falls with the third power of their length.
    constexpr int kMost = 8;
    const double wanted = std::ceil(std::cbrt(slip_mps / kWanted_mps));
    parts.push_back(std::clamp(static_cast<int>(std::min(wanted, 1e3)), 1, kMost));
    is_any |= parts.back() > 1;
  }
  if (!is_any) parts.clear();
  return parts;
}

/// The same motion with more states.
Trajectory cut_into(const Trajectory& trajectory, const std::vector<int>& parts) {
  Trajectory out;
  out.dof = trajectory.dof;
  std::vector<double> q(idx(trajectory.dof)), qdot(idx(trajectory.dof));
  const auto append = [&](double time_s, std::span<const double> at, std::span<const double> rate) {
    out.times_s.push_back(time_s);
    out.positions.insert(out.positions.end(), at.begin(), at.end());
    out.velocities.insert(out.velocities.end(), rate.begin(), rate.end());
  };
  for (int state = 0; state < trajectory.size(); ++state) {
    append(trajectory.times_s[idx(state)], trajectory.q(state), trajectory.qdot(state));
    if (state + 1 == trajectory.size()) break;
    const double begin_s = trajectory.times_s[idx(state)];
    const double h = trajectory.times_s[idx(state) + 1] - begin_s;
    for (int part = 1; part < parts[idx(state)]; ++part) {
      const double time_s = begin_s + h * part / parts[idx(state)];
      trajectory.sample(time_s, q, qdot);
      append(time_s, q, qdot);
    }
  }
  return out;
}

}  // namespace

bool roll(const RollingBase& base, Trajectory& trajectory) {
  constexpr int kMaxRounds = 4;
  if (trajectory.size() < 2) return true;
  Trajectory slipping = trajectory;
  for (int round = 0;; ++round) {
    const BaseWay way(base, slipping, false);
    const auto change = aim(base, way, slipping);
    if (!change) return false;
    Trajectory rolling = slipping;
    write(base, way, change->x(), change->y(), rolling);
    for (const int joint : {base.x, base.y}) {
      rolling.q(rolling.size() - 1)[idx(joint)] = slipping.q(slipping.size() - 1)[idx(joint)];
    }
    const std::vector<int> parts = parts_to_roll(base, rolling);
    if (parts.empty()) {
      trajectory = std::move(rolling);
      return true;
    }
    if (round == kMaxRounds) return false;
    slipping = cut_into(slipping, parts);
  }
}

void roll_freely(const RollingBase& base, Trajectory& trajectory) {
  if (trajectory.size() < 2) return;
  const BaseWay way(base, trajectory, true);
  write(base, way, 0.0, 0.0, trajectory);
}

namespace detail {

Trajectory with_way(const Trajectory& path, const RollingBase& base) {
  Trajectory with;
  with.dof = path.dof + 1;
  with.times_s = path.times_s;
  std::vector<double> q(idx(path.dof)), qdot(idx(path.dof));
  double way_m = 0.0, before = 0.0;
  for (int state = 0; state < path.size(); ++state) {
    const double speed = base_speed(base, path.q(state), path.qdot(state)).ahead_mps;
    if (state > 0) {
      const double h = path.times_s[idx(state)] - path.times_s[idx(state) - 1];
      path.sample(path.times_s[idx(state)] - 0.5 * h, q, qdot);
      way_m += h / 6.0 * (before + 4.0 * base_speed(base, q, qdot).ahead_mps + speed);
    }
    with.positions.insert(with.positions.end(), path.q(state).begin(), path.q(state).end());
    with.positions.push_back(way_m);
    with.velocities.insert(with.velocities.end(), path.qdot(state).begin(), path.qdot(state).end());
    with.velocities.push_back(speed);
    before = speed;
  }
  return with;
}

MotionLimits with_way(MotionLimits limits) {
  constexpr double kKeptFree = 5e-4;  // of accelerations, which roll() moves by less
  const RollingBase base = *limits.rolling;
  for (auto* values : {&limits.acceleration, &limits.braking}) {
    for (const int joint : {base.x, base.y, base.yaw}) {
      if (!values->empty()) (*values)[idx(joint)] *= 1.0 - kKeptFree;
    }
  }
  const std::size_t x = idx(base.x);
  for (auto* values : {&limits.velocity, &limits.acceleration, &limits.braking}) {
    if (x < values->size()) values->push_back(double((*values)[x]));
  }
  if (!limits.names.empty()) limits.names.emplace_back("the base's way");
  limits.rolling.reset();
  return limits;
}

Trajectory without_way(const Trajectory& with) {
  Trajectory out;
  out.dof = with.dof - 1;
  out.times_s = with.times_s;
  for (int state = 0; state < with.size(); ++state) {
    const auto q = with.q(state), qdot = with.qdot(state);
    out.positions.insert(out.positions.end(), q.begin(), q.end() - 1);
    out.velocities.insert(out.velocities.end(), qdot.begin(), qdot.end() - 1);
  }
  return out;
}

}  // namespace detail

RollingExtremes rolling_extremes(const RollingBase& base, const Trajectory& trajectory,
                                 double from_s, double to_s) {
  constexpr int kLooks = 8;
  constexpr double kTurnOfLook_rad = 0.2;
  constexpr double kMostLooks = 10'000.0;
  RollingExtremes most;
  std::vector<double> q(idx(trajectory.dof)), qdot(idx(trajectory.dof));
  for (int state = 0; state + 1 < trajectory.size(); ++state) {
    const double begin_s = std::max(from_s, trajectory.times_s[idx(state)]);
    const double end_s = std::min(to_s, trajectory.times_s[idx(state) + 1]);
    if (begin_s > end_s) continue;
    // A heading that turns in between must not go unseen.
    const std::size_t yaw = idx(base.yaw);
    const double turn =
        std::abs(trajectory.q(state + 1)[yaw] - trajectory.q(state)[yaw]) +
        (trajectory.times_s[idx(state) + 1] - trajectory.times_s[idx(state)]) *
            (std::abs(trajectory.qdot(state)[yaw]) + std::abs(trajectory.qdot(state + 1)[yaw]));
    const int looks = kLooks + static_cast<int>(std::min(kMostLooks, turn / kTurnOfLook_rad));
    for (int look = 0; look <= looks; ++look) {
      const double at_s = begin_s + (end_s - begin_s) * look / looks;
      trajectory.sample(at_s, q, qdot);
      const BaseSpeed speed = base_speed(base, q, qdot);
      if (const double left = std::abs(speed.left_mps); left > most.left_mps) {
        most.left_mps = left;
        most.left_at_s = at_s;
      }
      if (const double ahead = std::abs(speed.ahead_mps); ahead > most.ahead_mps) {
        most.ahead_mps = ahead;
        most.ahead_at_s = at_s;
      }
    }
  }
  return most;
}

}  // namespace sidestep
