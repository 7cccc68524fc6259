#include "steering.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/rolling.hpp>

namespace sidestep::joint_paths {
namespace {

/// A shorter drive has no direction; a smaller turn is rounding. In m and rad.
constexpr double kLeast = 1e-9;

}  // namespace

bool Steering::is_free(std::size_t joint) const noexcept {
  if (!base_) return true;
  return joint != idx(base_->x) && joint != idx(base_->y) && joint != idx(base_->yaw);
}

void Steering::append(std::span<const double> from, std::span<const double> to,
                      std::vector<double>& way) const {
  if (base_) {
    const std::size_t x = idx(base_->x), y = idx(base_->y), yaw = idx(base_->yaw);
    const double dx = (to[x] - from[x]) / scale_[x], dy = (to[y] - from[y]) / scale_[y];
    const double distance_m = std::hypot(dx, dy);
    if (distance_m > kLeast) {
      const double begin = from[yaw] / scale_[yaw], end = to[yaw] / scale_[yaw];
      const double middle = 0.5 * (begin + end);
      double turn = std::remainder(std::atan2(dy, dx) - middle, std::numbers::pi);
      // Beside each other, either way turns as far: not rounding chooses, but the left does.
      if (turn < kLeast - 0.5 * std::numbers::pi) turn += std::numbers::pi;
      const double heading = middle + turn;
      const double before = std::abs(heading - begin), behind = std::abs(end - heading);
      const double whole = before + distance_m + behind;
      const auto add = [&](std::span<const double> base, double part) {
        const std::size_t at = way.size();
        for (std::size_t j = 0; j < from.size(); ++j) {
          way.push_back(from[j] + part * (to[j] - from[j]));
        }
        way[at + x] = base[x];
        way[at + y] = base[y];
        way[at + yaw] = heading * scale_[yaw];
      };
      if (before > kLeast) add(from, before / whole);
      if (behind > kLeast) add(to, (before + distance_m) / whole);
    }
  }
  way.insert(way.end(), to.begin(), to.end());
}

namespace {

double distance(std::span<const double> a, std::span<const double> b) noexcept {
  double squares = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) squares += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(squares);
}

void interpolate(std::span<const double> from, std::span<const double> to, double part,
                 std::span<double> between) noexcept {
  for (std::size_t j = 0; j < between.size(); ++j) {
    between[j] = part == 1.0 ? to[j] : from[j] + part * (to[j] - from[j]);
  }
}

}  // namespace

void Way::look(const Steering& steering, std::span<const double> from, std::span<const double> to) {
  dof_ = from.size();
  vertices_.assign(from.begin(), from.end());
  steering.append(from, to, vertices_);
  length_ = 0.0;
  for (std::size_t i = 1; i < vertices_.size() / dof_; ++i) {
    length_ += distance(vertex(i - 1), vertex(i));
  }
}

void Way::at(double part, std::span<double> between) const noexcept {
  const std::size_t last = vertices_.size() / dof_ - 1;
  if (last == 1) return interpolate(vertex(0), vertex(1), part, between);
  double left = part * length_;
  for (std::size_t i = 1; i <= last; ++i) {
    const double piece = distance(vertex(i - 1), vertex(i));
    if (i == last || left < piece) {
      const double of_piece = piece > 0.0 && part < 1.0 ? std::min(1.0, left / piece) : 1.0;
      return interpolate(vertex(i - 1), vertex(i), of_piece, between);
    }
    left -= piece;
  }
}

namespace {

constexpr double kMostTurn_rad = 2.1;  ///< Of a curve: beyond, it would be mostly detour.
constexpr double kMostLeg_m = 1.5;     ///< That a curve takes from a drive.
constexpr double kLeastLeg_m = 0.02;
constexpr double kMostSlip = 2e-5;          ///< Of a curve's cubic pieces, of the speed.
constexpr double kTurnOfChord_rad = 0.025;  ///< A metre from it, they are 8e-5 m beside it.

/// One of the straight motions of a path.
struct Straight {
  std::vector<double> from, to;
  double way_m = 0.0;  ///< Of the base: ahead, or back if negative; 0 where it turns, or stands.
};

/// A motion along the path whose parameter grows evenly with the way of the base, or, where that
/// stands, with the fastest joint's. Between states it is cubic.
class PathWriter {
 public:
  explicit PathWriter(std::span<const double> start) {
    path_.dof = static_cast<int>(start.size());
    append(0.0, start, std::vector<double>(start.size()));
  }
  /// `rates`: per unit of the parameter, which `step` adds to.
  void append(double step, std::span<const double> q, std::span<const double> rates) {
    path_.times_s.push_back(path_.times_s.empty() ? 0.0 : path_.times_s.back() + step);
    path_.positions.insert(path_.positions.end(), q.begin(), q.end());
    path_.velocities.insert(path_.velocities.end(), rates.begin(), rates.end());
  }
  [[nodiscard]] Trajectory take() && { return std::move(path_); }

 private:
  Trajectory path_;
};

/// Turns a path of straight motions into one that is driven through where it can be.
class Driver {
 public:
  Driver(const Problem& problem, std::span<const double> path, Checker& checker,
         double resolution_m, const Deadline& deadline)
      : robot_(problem.robot->description()),
        base_(*robot_.rolling),
        dof_(idx(robot_.dof())),
        checker_(checker),
        resolution_m_(resolution_m),
        deadline_(deadline) {
    const Steering steering(robot_, std::vector<double>(dof_, 1.0));
    Way way;
    for (std::size_t i = dof_; i < path.size(); i += dof_) {
      way.look(steering, path.subspan(i - dof_, dof_), path.subspan(i, dof_));
      for (std::size_t v = dof_; v < way.vertices().size(); v += dof_) {
        add(way.vertices().subspan(v - dof_, dof_), way.vertices().subspan(v, dof_));
      }
    }
    start_.assign(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(dof_));
  }

  Trajectory run() {
    PathWriter writer(start_);
    double taken_m = 0.0;  // of the drive that comes, by the curve before it
    bool is_moving = false;
    for (std::size_t i = 0; i < motions_.size(); ++i) {
      const Straight& motion = motions_[i];
      if (motion.way_m == 0.0) {
        stand(motion, writer);
        continue;
      }
      const std::size_t next = next_drive(i);
      const Curve curve = next < motions_.size() ? curve_between(i, next) : Curve{};
      straight(motion, taken_m, curve.leg_m, is_moving, writer);
      is_moving = curve.leg_m > 0.0;
      taken_m = curve.leg_m;
      if (!is_moving) continue;
      for (int state = curve.chords; state < curve.path.size(); state += curve.chords) {
        writer.append(
            curve.path.times_s[idx(state)] - curve.path.times_s[idx(state - curve.chords)],
            curve.path.q(state), curve.path.qdot(state));
      }
      i = next - 1;
    }
    return std::move(writer).take();
  }

 private:
  /// From one drive into the next, with both its ends.
  struct Curve {
    double leg_m = 0.0;  ///< Of each of the drives; 0: there is none.
    int chords = 1;      ///< As many of its pieces are a cubic of the path.
    Trajectory path;     ///< By its way, in m.
  };

  static double direction(const Straight& motion) noexcept {
    return std::copysign(1.0, motion.way_m);
  }

  void add(std::span<const double> from, std::span<const double> to) {
    const double dx = to[idx(base_.x)] - from[idx(base_.x)];
    const double dy = to[idx(base_.y)] - from[idx(base_.y)];
    const double yaw = from[idx(base_.yaw)];
    Straight motion{{from.begin(), from.end()}, {to.begin(), to.end()}, 0.0};
    const double way_m = std::hypot(dx, dy);
    if (way_m > kLeast) {
      motion.way_m = std::copysign(way_m, dx * std::cos(yaw) + dy * std::sin(yaw));
    }
    if (way_m <= kLeast && furthest(motion) <= kLeast) return;  // the next begins as near
    if (!motions_.empty() && goes_on(motions_.back(), motion)) {
      motions_.back().to = std::move(motion.to);
      motions_.back().way_m += motion.way_m;
    } else {
      motions_.push_back(std::move(motion));
    }
  }

  /// The greatest change of a joint.
  [[nodiscard]] double furthest(const Straight& motion) const {
    double most = 0.0;
    for (std::size_t j = 0; j < dof_; ++j) {
      most = std::max(most, std::abs(motion.to[j] - motion.from[j]));
    }
    return most;
  }

  /// Whether two drives are one.
  [[nodiscard]] bool goes_on(const Straight& first, const Straight& second) const {
    if (!(first.way_m * second.way_m > 0.0)) return false;
    const std::vector<double> before = rates_of(first), behind = rates_of(second);
    for (std::size_t j = 0; j < dof_; ++j) {
      if (std::abs(before[j] - behind[j]) > kLeast) return false;
    }
    return true;
  }

  [[nodiscard]] std::size_t next_drive(std::size_t drive) const {
    std::size_t next = drive + 1;
    while (next < motions_.size() && motions_[next].way_m == 0.0) ++next;
    return next;
  }

  /// A motion without the base's driving, from rest to rest.
  void stand(const Straight& motion, PathWriter& writer) const {
    writer.append(furthest(motion), motion.to, std::vector<double>(dof_));
  }

  /// What two curves leave of a drive; at rest where there is none.
  void straight(const Straight& motion, double before_m, double behind_m, bool is_moving,
                PathWriter& writer) const {
    const double whole_m = std::abs(motion.way_m);
    const double left_m = whole_m - before_m - behind_m;
    if (left_m <= kLeast) return;
    const bool goes_on = behind_m > 0.0;
    const std::vector<double> to = at(motion, 1.0 - behind_m / whole_m);
    // From rest to full speed or back the way of a quadratic is half as long as at full speed.
    const double halves = (is_moving ? 0.0 : 1.0) + (goes_on ? 0.0 : 1.0);
    const double step = left_m * (halves == 1.0 ? 2.0 : 1.0);
    writer.append(step, to, goes_on ? rates_of(motion) : std::vector<double>(dof_));
  }

  [[nodiscard]] std::vector<double> at(const Straight& motion, double part) const {
    std::vector<double> q(motion.to);
    if (part == 1.0) return q;
    for (std::size_t j = 0; j < dof_; ++j) {
      q[j] = motion.from[j] + part * (motion.to[j] - motion.from[j]);
    }
    return q;
  }

  /// Of each joint, per metre of way.
  [[nodiscard]] std::vector<double> rates_of(const Straight& motion) const {
    std::vector<double> rates(dof_);
    for (std::size_t j = 0; j < dof_; ++j) {
      rates[j] = (motion.to[j] - motion.from[j]) / std::abs(motion.way_m);
    }
    return rates;
  }

  Curve curve_between(std::size_t first, std::size_t second) {
    const Straight &before = motions_[first], &behind = motions_[second];
    if (before.way_m * behind.way_m < 0.0) return {};
    const double turn = behind.from[idx(base_.yaw)] - before.from[idx(base_.yaw)];
    if (std::abs(turn) > kMostTurn_rad) return {};
    double leg_m =
        std::min({kMostLeg_m, 0.5 * std::abs(before.way_m), 0.5 * std::abs(behind.way_m)});
    while (leg_m >= kLeastLeg_m) {
      Curve curve = make_curve(before, behind, turn, leg_m);
      if (is_clear(curve)) return curve;
      leg_m *= 0.5;
    }
    return {};
  }

  /// The heading goes over from one to the other as 3 u^2 - 2 u^3 with the way, so that the wheels
  /// need not jump; the curve is symmetric, and so meets both drives as far from their corner.
  [[nodiscard]] Curve make_curve(const Straight& before, const Straight& behind, double turn,
                                 double leg_m) const {
    const double yaw = before.from[idx(base_.yaw)];
    const auto share = [](double u) { return u * u * (3.0 - 2.0 * u); };
    const auto slope = [](double u) { return 6.0 * u * (1.0 - u); };
    // The velocity of a cubic between states h apart is off by at most sqrt(3)/216 h^3 times the
    // fourth derivative, which here is 12 t + 27 t^2 + 3.4 t^3 by the way, at most, of a turn t.
    const double t = std::abs(turn);
    const double least = std::cbrt(0.00802 * t * (12.0 + t * (27.0 + t * 3.4)) / kMostSlip);
    const double cubics = std::ceil(std::max(4.0, least));
    const double chords = std::ceil(1.5 * t / kTurnOfChord_rad / cubics);  // in a cubic
    const double pieces = cubics * std::max(1.0, chords);
    const double sign = direction(before);
    // Along a way of so many metres, from the first drive's cut on.
    const auto along = [&](double length_m) {
      Trajectory curve =
          make_trajectory(robot_.dof(), static_cast<int>(pieces) + 1, length_m / pieces);
      const std::vector<double> from = at(before, 1.0 - leg_m / std::abs(before.way_m));
      const std::vector<double> to = at(behind, leg_m / std::abs(behind.way_m));
      const std::vector<double> rates_from = rates_of(before), rates_to = rates_of(behind);
      for (int i = 0; i < curve.size(); ++i) {
        const double u = i / pieces;
        const auto q = curve.q(i), rates = curve.qdot(i);
        // The other joints: Hermite's cubic from drive to drive.
        for (std::size_t j = 0; j < dof_; ++j) {
          const double v0 = rates_from[j] * length_m, v1 = rates_to[j] * length_m;
          const double d = to[j] - from[j];
          const double c2 = 3.0 * d - 2.0 * v0 - v1, c3 = v0 + v1 - 2.0 * d;
          q[j] = from[j] + u * (v0 + u * (c2 + u * c3));
          rates[j] = (v0 + u * (2.0 * c2 + u * 3.0 * c3)) / length_m;
        }
        const double heading = yaw + turn * share(u);
        q[idx(base_.yaw)] = heading;
        rates[idx(base_.yaw)] = turn * slope(u) / length_m;
        rates[idx(base_.x)] = sign * std::cos(heading);
        rates[idx(base_.y)] = sign * std::sin(heading);
      }
      roll_freely(base_, curve);
      return curve;
    };
    const Trajectory unit = along(1.0);
    const auto begin = unit.q(0), end = unit.q(unit.size() - 1);
    const double reach = std::hypot(end[idx(base_.x)] - begin[idx(base_.x)],
                                    end[idx(base_.y)] - begin[idx(base_.y)]);
    const double length_m = 2.0 * leg_m * std::cos(0.5 * turn) / reach;
    return {leg_m, std::max(1, static_cast<int>(chords)), along(length_m)};
  }

  [[nodiscard]] bool is_clear(const Curve& curve) {
    for (int state = 0; state < curve.path.size(); ++state) {
      const auto q = curve.path.q(state);
      for (std::size_t j = 0; j < dof_; ++j) {
        if (q[j] < robot_.joints[j].lower || q[j] > robot_.joints[j].upper) return false;
      }
      if (state == 0) continue;
      if (deadline_.expired() || !checker_.is_clear(curve.path.q(state - 1), q, resolution_m_)) {
        return false;
      }
    }
    return true;
  }

  const RobotDescription& robot_;
  RollingBase base_;
  std::size_t dof_;
  Checker& checker_;
  double resolution_m_;
  const Deadline& deadline_;
  std::vector<double> start_;
  std::vector<Straight> motions_;
};

}  // namespace

Result<Trajectory> drive(const Problem& problem, std::span<const double> path, Checker& checker,
                         double resolution_m, const Deadline& deadline) {
  const RobotDescription& robot = problem.robot->description();
  const Trajectory geometry = Driver(problem, path, checker, resolution_m, deadline).run();
  Retiming timed = SIDESTEP_TRY(
      retime(geometry, motion_limits(robot, {.speed_fraction = problem.speed_fraction})));
  return std::move(timed.trajectory);
}

}  // namespace sidestep::joint_paths
