#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/trajectory/rolling.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "clearance_prover.hpp"
#include "cubic_motion.hpp"
#include "edge_prover.hpp"

namespace sidestep {
namespace {

/// Of positions, relative: what it makes of an acceleration over a short piece is no acceleration.
constexpr double kRounding = 24e-15;
/// Pieces are proven clear together until they move the robot by about this much.
constexpr double kProof_m = 0.3;
constexpr double kMostParts = 1000.0;

/// Pieces farther than this from a chord begin another: long chords first, and where they cannot
/// be shown clear, shorter ones.
constexpr double kBeside_m[] = {2e-3, 5e-4};

/// Calls with the control points of the piece after a state, less the first: three in a row.
template <class Call>
void for_control_points(const Trajectory& trajectory, int state, Call&& call) {
  const auto at = idx(state);
  const double third_s = (trajectory.times_s[at + 1] - trajectory.times_s[at]) / 3.0;
  const auto q0 = trajectory.q(state), q1 = trajectory.q(state + 1);
  const auto v0 = trajectory.qdot(state), v1 = trajectory.qdot(state + 1);
  call([=](std::size_t j) { return q0[j] + third_s * v0[j]; });
  call([=](std::size_t j) { return q1[j] - third_s * v1[j]; });
  call([=](std::size_t j) { return q1[j]; });
}

/// How far a configuration is from the line through `from` towards `to`, or from what lies between
/// the two, as motion of spheres.
template <class Point>
double off_line_m(std::span<const double> from, std::span<const double> to, bool is_ray,
                  std::span<const double> levers, const Point& point) {
  double along = 0.0, square = 0.0;
  for (std::size_t j = 0; j < levers.size(); ++j) {
    const double step = to[j] - from[j];
    along += step * (point(j) - from[j]);
    square += step * step;
  }
  double share = square > 0.0 ? std::max(0.0, along / square) : 0.0;
  if (!is_ray) share = std::min(1.0, share);
  double sum_m = 0.0;
  for (std::size_t j = 0; j < levers.size(); ++j) {
    const double off = std::abs(point(j) - (from[j] + share * (to[j] - from[j])));
    if (off > 0.0) sum_m += levers[j] * off;
  }
  return sum_m;
}

/// Shows trajectories clear of exact shapes along chords: where several cubic pieces in a row keep
/// close to the straight line between their ends, as all of a sampled path between two corners
/// does, they are clear if that line is, by as much more as they are away from it. Says nothing of
/// trajectories that it cannot show clear: ClearanceProver tells what is wrong with them.
///
/// A piece lies within the convex hull of its Bezier control points, and so within the largest of
/// their distances from the chord; a configuration that is away from the chord by v_j in each joint
/// moves no sphere by more than the sum of lever_j v_j.
class ChordCheck {
 public:
  /// `levers`: by joint, at least those of every sphere and pair (motion_bounds.hpp).
  ChordCheck(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const MotionBounds> bounds,
             std::span<const double> levers, std::shared_ptr<const SceneField> field,
             const SpacePolicy& space, double margin_m)
      : levers_(levers.begin(), levers.end()), prover_(std::move(robot), std::move(bounds)) {
    prover_.look_at(std::move(field), space, margin_m);
  }

  /// Whether all of the trajectory from one of its states on is shown clear; chords that are not
  /// before no sphere moves more than `resolution_m` between looks end it. [any]
  [[nodiscard]] bool shows_clear(const Trajectory& trajectory, int from_state, double resolution_m,
                                 const Deadline& deadline) const {
    const std::scoped_lock lock(mutex_);
    for (int first = from_state; first + 1 < trajectory.size();) {
      if (deadline.expired()) return false;
      int last = first;
      for (const double most_m : kBeside_m) {
        const int end = chord_end(trajectory, first, most_m);
        const double beside = beside_m(trajectory, first, end);
        if (!(beside < 2.0 * most_m)) continue;
        if (!prover_.is_clear(trajectory.q(first), trajectory.q(end), resolution_m, beside))
          continue;
        last = end;
        break;
      }
      if (last == first) return false;
      first = last;
    }
    return true;
  }

 private:
  /// The last state that a chord from `first` may reach.
  [[nodiscard]] int chord_end(const Trajectory& trajectory, int first, double most_m) const {
    // The direction is that of the first piece that leads anywhere.
    int ahead = first + 1;
    while (ahead + 1 < trajectory.size() &&
           std::ranges::equal(trajectory.q(first), trajectory.q(ahead))) {
      ++ahead;
    }
    int last = first + 1;
    for (; last + 1 < trajectory.size(); ++last) {
      bool is_near = true;
      for_control_points(trajectory, last, [&](const auto& point) {
        is_near = is_near && off_line_m(trajectory.q(first), trajectory.q(ahead), true, levers_,
                                        point) < most_m;
      });
      if (!is_near) break;
    }
    return last;
  }

  /// The largest distance of pieces from the chord between their ends, as motion of spheres.
  [[nodiscard]] double beside_m(const Trajectory& trajectory, int first, int last) const {
    double most_m = 0.0;
    for (int state = first; state < last; ++state) {
      for_control_points(trajectory, state, [&](const auto& point) {
        most_m = std::max(
            most_m, off_line_m(trajectory.q(first), trajectory.q(last), false, levers_, point));
      });
    }
    return most_m;
  }

  std::vector<double> levers_;
  mutable std::mutex mutex_;  ///< Of what follows.
  mutable EdgeProver prover_;
};
/// Collects what the prover finds into a verdict.
class VerdictBuilder final : public ClearanceProver::Listener {
 public:
  VerdictBuilder(const ClearanceProver& prover, bool first_only)
      : prover_(prover), first_only_(first_only), looks_(idx(prover.sphere_count())) {}

  bool on_reading(double t, int item, const ClearanceReading& reading) override {
    if (prover_.violates(item, reading)) ledger_.add(violation_of(prover_, item, reading, t));
    if (item >= prover_.sphere_count()) {
      min_self_clearance_m_ = std::min(min_self_clearance_m_, reading.clearance_m);
      return true;
    }
    Looks& looks = looks_[idx(item)];
    ++looks.all;
    if (reading.status != FieldStatus::kKnown) ++looks.unknown;
    if (reading.clearance_m < min_clearance_m_) {
      min_clearance_m_ = reading.clearance_m;
      min_clearance_item_ = item;
      min_clearance_time_s_ = t;
      clearance_is_bound_ = prover_.is_at_limit(item, reading);
    }
    return true;
  }
  bool on_unproven(double t, int item, const Shortfall& shortfall) override {
    ledger_.add(unproven(prover_, item, shortfall, t));
    return true;
  }
  /// Whether nothing more needs to be found.
  [[nodiscard]] bool is_decided() const noexcept { return first_only_ && !ledger_.empty(); }
  ViolationLedger& ledger() noexcept { return ledger_; }

  [[nodiscard]] Verdict verdict() const {
    Verdict verdict;
    verdict.violations = ledger_.sorted();
    verdict.first_violation_s = ledger_.first_s();
    verdict.outcome = Verdict::Outcome::kValid;
    if (!verdict.violations.empty()) {
      const bool is_proven = verdict.violations.front().kind != Violation::Kind::kUnproven;
      verdict.outcome = is_proven ? Verdict::Outcome::kInvalid : Verdict::Outcome::kUnproven;
    }
    const RobotDescription& robot = prover_.robot().description();
    verdict.min_clearance_m = min_clearance_m_;
    verdict.clearance_is_bound = clearance_is_bound_;
    verdict.min_self_clearance_m = min_self_clearance_m_;
    if (min_clearance_item_ >= 0) {
      const int link = robot.spheres[idx(min_clearance_item_)].link;
      verdict.min_clearance_link = robot.links[idx(link)].name;
      verdict.min_clearance_time_s = min_clearance_time_s_;
    }
    tell_unknown(verdict);
    return verdict;
  }

 private:
  /// Checks of a sphere, or of several.
  struct Looks {
    std::int64_t all = 0;
    std::int64_t unknown = 0;

    void add(const Looks& others) noexcept {
      all += others.all;
      unknown += others.unknown;
    }
    [[nodiscard]] double unknown_share() const noexcept {
      return all > 0 ? static_cast<double>(unknown) / static_cast<double>(all) : 0.0;
    }
  };

  void tell_unknown(Verdict& verdict) const {
    const RobotDescription& robot = prover_.robot().description();
    Looks whole;
    for (const Looks& looks : looks_) whole.add(looks);
    verdict.unknown_share = whole.unknown_share();
    if (whole.unknown == 0) return;
    // Where something of the robot stands that no joint moves, no camera need look.
    const std::vector<bool> fixed = fixed_spheres(prover_.robot());
    std::vector<Looks> of_link(robot.links.size());
    for (std::size_t s = 0; s < looks_.size(); ++s) {
      if (!fixed[s]) of_link[idx(robot.spheres[s].link)].add(looks_[s]);
    }
    for (std::size_t link = 0; link < of_link.size(); ++link) {
      const double share = of_link[link].unknown_share();
      if (share <= verdict.most_unknown_share) continue;
      verdict.most_unknown_share = share;
      verdict.most_unknown_link = robot.links[link].name;
    }
  }

  const ClearanceProver& prover_;
  bool first_only_;
  ViolationLedger ledger_;
  double min_clearance_m_ = kInfinity;
  int min_clearance_item_ = -1;
  double min_clearance_time_s_ = 0.0;
  bool clearance_is_bound_ = false;
  double min_self_clearance_m_ = kInfinity;
  std::vector<Looks> looks_;  ///< Of each sphere.
};

/// A motion that stands still.
class Rest final : public Motion {
 public:
  explicit Rest(std::span<const double> q) : q_(q) {}
  void configuration(double, std::span<double> q) const override {
    std::ranges::copy(q_, q.begin());
  }
  void variation(double, double, std::span<double> v) const override { std::ranges::fill(v, 0.0); }

 private:
  std::span<const double> q_;
};

class FieldCheck final : public ValidityCheck {
 public:
  FieldCheck(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const MotionBounds> bounds,
             std::shared_ptr<const DistanceField> field, SpacePolicy space,
             FieldCheckSettings settings)
      : robot_(std::move(robot)),
        prover_(robot_, bounds, field, space, settings.margin_m, settings.obstacles_only),
        settings_(settings) {
    auto shapes = std::dynamic_pointer_cast<const SceneField>(field);
    if (shapes == nullptr || !settings.first_violation_only || settings.obstacles_only) return;
    chords_.emplace(robot_, std::move(bounds), prover_.largest_levers(), std::move(shapes), space,
                    settings.margin_m);
  }

  [[nodiscard]] Result<Verdict> check(const Trajectory& trajectory, double from_s,
                                      const Deadline& deadline) const override {
    SIDESTEP_TRY(validate(trajectory, from_s));
    const double begin_s = std::clamp(from_s, 0.0, trajectory.duration_s());
    VerdictBuilder builder(prover_, settings_.first_violation_only);
    check_rolling(trajectory, begin_s, builder.ledger());
    ClearanceProver::WorkspacePtr workspace;
    const auto prove = [&](const Motion& motion, double from, double to) {
      const ClearanceProver::Request request{motion,
                                             from,
                                             to,
                                             settings_.max_step_m,
                                             settings_.min_step_m,
                                             workspace != nullptr,
                                             from < begin_s + settings_.observed_s};
      if (workspace == nullptr) workspace = prover_.make_workspace();
      return prover_.prove(request, builder, deadline, *workspace) !=
             ClearanceProver::End::kDeadline;
    };
    if (begin_s >= trajectory.duration_s()) {
      const int last = trajectory.size() - 1;
      check_state_limits(trajectory, last, builder.ledger());
      if (!prove(Rest(trajectory.q(last)), begin_s, begin_s)) {
        return tl::make_unexpected(late(trajectory, begin_s));
      }
      return builder.verdict();
    }
    const auto time_of = [&](int state) { return trajectory.times_s[idx(state)]; };
    CubicChain chain;
    std::vector<double> variation(idx(trajectory.dof));
    int state = 0;
    while (time_of(state + 1) <= begin_s) ++state;
    if (chords_ && chords_->shows_clear(trajectory, state, settings_.min_step_m, deadline)) {
      CubicMotion piece;
      for (; state + 1 < trajectory.size() && !builder.is_decided(); ++state) {
        piece.take(trajectory, state);
        check_limits(piece, std::max(begin_s, time_of(state)), time_of(state + 1),
                     builder.ledger());
      }
      return builder.verdict();
    }
    while (state + 1 < trajectory.size() && !builder.is_decided()) {
      const double chain_from_s = std::max(begin_s, time_of(state));
      double way_m = 0.0;
      for (chain.clear(); state + 1 < trajectory.size() && way_m < kProof_m; ++state) {
        const CubicMotion& piece = chain.append(trajectory, state);
        const double piece_from_s = std::max(begin_s, time_of(state));
        check_limits(piece, piece_from_s, time_of(state + 1), builder.ledger());
        chain.variation(piece_from_s, time_of(state + 1), variation);
        way_m += prover_.way_bound_m(variation);
      }
      // A long piece of which the first violation matters is proven in parts.
      const double to_s = time_of(state);
      const double most_parts = settings_.first_violation_only ? kMostParts : 1.0;
      const int parts =
          std::max(1, static_cast<int>(std::ceil(std::min(most_parts, way_m / kProof_m))));
      for (int part = 0; part < parts && !builder.is_decided(); ++part) {
        const auto at = [&](int p) {
          return p == parts ? to_s : chain_from_s + (to_s - chain_from_s) * p / parts;
        };
        if (!prove(chain, at(part), at(part + 1))) {
          return tl::make_unexpected(late(trajectory, at(part)));
        }
      }
    }
    return builder.verdict();
  }

 private:
  [[nodiscard]] Result<void> validate(const Trajectory& trajectory, double from_s) const {
    const int dof = robot_->description().dof();
    if (trajectory.dof != dof) {
      return invalid("the trajectory moves " + std::to_string(trajectory.dof) +
                     " joints, the robot has " + std::to_string(dof));
    }
    SIDESTEP_TRY(trajectory.validate());
    if (trajectory.size() == 0) return invalid("the trajectory is empty");
    if (std::isnan(from_s)) {
      return invalid("the time to check from is not a number");
    }
    return {};
  }

  void check_limits(const CubicMotion& motion, double from_s, double to_s,
                    ViolationLedger& ledger) const {
    if (settings_.obstacles_only) return;
    const double begin = from_s - motion.begin_s();
    const double end = to_s - motion.begin_s();
    const double piece_s = motion.duration_s();
    const std::vector<Joint>& joints = robot_->description().joints;
    for (std::size_t j = 0; j < motion.joints().size(); ++j) {
      const Cubic& cubic = motion.joints()[j];
      const auto within = [&](double s) { return s > begin && s < end; };
      for (const double s : {begin, end}) {
        ledger.check_position(joints[j], settings_.limit_tolerance, cubic.position(s),
                              motion.begin_s() + s);
        check_velocity(j, cubic.velocity(s), motion.begin_s() + s, ledger);
        check_acceleration(j, cubic.acceleration(s),
                           kRounding * std::abs(cubic.q0) / piece_s / piece_s, motion.begin_s() + s,
                           ledger);
      }
      for (const double s : motion.turns(j)) {
        if (!within(s)) continue;
        ledger.check_position(joints[j], settings_.limit_tolerance, cubic.position(s),
                              motion.begin_s() + s);
      }
      const double s = cubic.inflection();
      if (within(s)) check_velocity(j, cubic.velocity(s), motion.begin_s() + s, ledger);
    }
  }

  void check_state_limits(const Trajectory& trajectory, int state, ViolationLedger& ledger) const {
    if (settings_.obstacles_only) return;
    const double time_s = trajectory.times_s[idx(state)];
    const std::vector<Joint>& joints = robot_->description().joints;
    for (std::size_t j = 0; j < idx(trajectory.dof); ++j) {
      ledger.check_position(joints[j], settings_.limit_tolerance, trajectory.q(state)[j], time_s);
      check_velocity(j, trajectory.qdot(state)[j], time_s, ledger);
    }
  }

  void check_rolling(const Trajectory& trajectory, double from_s, ViolationLedger& ledger) const {
    const RobotDescription& robot = robot_->description();
    if (settings_.obstacles_only || !robot.rolling) return;
    const RollingExtremes most =
        rolling_extremes(*robot.rolling, trajectory, from_s, trajectory.duration_s());
    if (most.left_mps > kSlipTolerance_mps) {
      ledger.add({.kind = Violation::Kind::kSideways,
                  .subject = kBaseName,
                  .other = {},
                  .time_s = most.left_at_s,
                  .amount = most.left_mps});
    }
    const Joint& limits = robot.joints[idx(robot.rolling->x)];
    const double limit = settings_.speed_fraction * limits.max_velocity;
    if (most.ahead_mps <= limit + settings_.limit_tolerance) return;
    ledger.add({.kind = Violation::Kind::kVelocityLimit,
                .subject = kBaseName,
                .other = limit_name(limits, "velocity limit", limit, "/s"),
                .time_s = most.ahead_at_s,
                .amount = most.ahead_mps - limit});
  }

  void check_velocity(std::size_t joint, double velocity, double time_s,
                      ViolationLedger& ledger) const {
    const Joint& limits = robot_->description().joints[joint];
    const double limit = settings_.speed_fraction * limits.max_velocity;
    if (std::abs(velocity) <= limit + settings_.limit_tolerance) return;
    ledger.add({.kind = Violation::Kind::kVelocityLimit,
                .subject = limits.name,
                .other = limit_name(limits, "velocity limit", limit, "/s"),
                .time_s = time_s,
                .amount = std::abs(velocity) - limit});
  }

  void check_acceleration(std::size_t joint, double acceleration, double noise, double time_s,
                          ViolationLedger& ledger) const {
    const Joint& limits = robot_->description().joints[joint];
    if (!(limits.max_acceleration > 0.0)) return;  // not known
    const double limit = settings_.acceleration_fraction * limits.max_acceleration;
    if (std::abs(acceleration) <= limit + settings_.limit_tolerance + noise) return;
    ledger.add({.kind = Violation::Kind::kAccelerationLimit,
                .subject = limits.name,
                .other = limit_name(limits, "acceleration limit", limit, "/s^2"),
                .time_s = time_s,
                .amount = std::abs(acceleration) - limit});
  }

  [[nodiscard]] Error late(const Trajectory& trajectory, double time_s) const {
    return Error{ErrorCode::kDeadlineExceeded,
                 "the validity check ran out of time " + std::to_string(time_s) + " s into " +
                     std::to_string(trajectory.duration_s()) + " s of motion",
                 {},
                 {},
                 nullptr};
  }

  std::shared_ptr<const RobotModel> robot_;
  ClearanceProver prover_;
  FieldCheckSettings settings_;
  std::optional<ChordCheck> chords_;  ///< Where it is enough to know that all is well.
};

}  // namespace

std::unique_ptr<ValidityCheck> make_field_check(std::shared_ptr<const RobotModel> robot,
                                                std::shared_ptr<const DistanceField> field,
                                                SpacePolicy space, FieldCheckSettings settings) {
  return FieldChecks(std::move(robot)).make(std::move(field), std::move(space), settings);
}

std::unique_ptr<ValidityCheck> FieldChecks::make(std::shared_ptr<const DistanceField> field,
                                                 SpacePolicy space,
                                                 FieldCheckSettings settings) const {
  return std::make_unique<FieldCheck>(robot_, bounds_, std::move(field), std::move(space),
                                      settings);
}

}  // namespace sidestep
