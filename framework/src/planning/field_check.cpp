#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "chord_check.hpp"
#include "clearance_prover.hpp"
#include "cubic_motion.hpp"
#include "violation_ledger.hpp"

namespace sidestep {
namespace {

/// Of positions, relative: what it makes of an acceleration over a short piece is no acceleration.
constexpr double kRounding = 24e-15;
/// Pieces are proven clear together until they move the robot by about this much.
constexpr double kProof_m = 0.3;
constexpr double kMostParts = 1000.0;

/// Collects what the prover finds into a verdict.
class VerdictBuilder final : public ClearanceProver::Listener {
 public:
  VerdictBuilder(const ClearanceProver& prover, bool first_only)
      : prover_(prover),
        first_only_(first_only),
        looks_(static_cast<std::size_t>(prover.sphere_count())) {}

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

    [[nodiscard]] double unknown_share() const noexcept {
      return all > 0 ? static_cast<double>(unknown) / static_cast<double>(all) : 0.0;
    }
  };

  void tell_unknown(Verdict& verdict) const {
    const RobotDescription& robot = prover_.robot().description();
    Looks whole;
    std::vector<Looks> of_link(robot.links.size());
    for (std::size_t s = 0; s < looks_.size(); ++s) {
      const auto link = static_cast<std::size_t>(robot.spheres[s].link);
      for (Looks* sum : {&whole, &of_link[link]}) {
        sum->all += looks_[s].all;
        sum->unknown += looks_[s].unknown;
      }
    }
    verdict.unknown_share = whole.unknown_share();
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
  double min_clearance_m_ = std::numeric_limits<double>::infinity();
  int min_clearance_item_ = -1;
  double min_clearance_time_s_ = 0.0;
  bool clearance_is_bound_ = false;
  double min_self_clearance_m_ = std::numeric_limits<double>::infinity();
  std::vector<Looks> looks_;  ///< Of each sphere.
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
                                      const Deadline& deadline) const override;

 private:
  [[nodiscard]] Result<void> validate(const Trajectory& trajectory, double from_s) const;
  void check_limits(const CubicMotion& motion, double from_s, double to_s,
                    ViolationLedger& ledger) const;
  void check_state_limits(const Trajectory& trajectory, int state, ViolationLedger& ledger) const;
  void check_position(std::size_t joint, double position, double time_s,
                      ViolationLedger& ledger) const;
  void check_velocity(std::size_t joint, double velocity, double time_s,
                      ViolationLedger& ledger) const;
  void check_acceleration(std::size_t joint, double acceleration, double noise, double time_s,
                          ViolationLedger& ledger) const;
  [[nodiscard]] Error late(const Trajectory& trajectory, double time_s) const;

  std::shared_ptr<const RobotModel> robot_;
  ClearanceProver prover_;
  FieldCheckSettings settings_;
  std::optional<ChordCheck> chords_;  ///< Where it is enough to know that all is well.
};

/// A motion that stands still.
class Rest final : public Motion {
 public:
  explicit Rest(std::span<const double> q) : q_(q) {}
  void configuration(double, std::span<double> q) const override {
    std::copy(q_.begin(), q_.end(), q.begin());
  }
  void variation(double, double, std::span<double> v) const override {
    std::fill(v.begin(), v.end(), 0.0);
  }

 private:
  std::span<const double> q_;
};

Result<Verdict> FieldCheck::check(const Trajectory& trajectory, double from_s,
                                  const Deadline& deadline) const {
  SIDESTEP_TRY(validate(trajectory, from_s));
  const double begin_s = std::clamp(from_s, 0.0, trajectory.duration_s());
  VerdictBuilder builder(prover_, settings_.first_violation_only);
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
    return prover_.prove(request, builder, deadline, *workspace) != ClearanceProver::End::kDeadline;
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
  std::vector<double> variation(static_cast<std::size_t>(trajectory.dof));
  int state = 0;
  while (time_of(state + 1) <= begin_s) ++state;
  if (chords_ && chords_->shows_clear(trajectory, state, settings_.min_step_m, deadline)) {
    CubicMotion piece;
    for (; state + 1 < trajectory.size() && !builder.is_decided(); ++state) {
      piece.take(trajectory, state);
      check_limits(piece, std::max(begin_s, time_of(state)), time_of(state + 1), builder.ledger());
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

Result<void> FieldCheck::validate(const Trajectory& trajectory, double from_s) const {
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

void FieldCheck::check_position(std::size_t joint, double position, double time_s,
                                ViolationLedger& ledger) const {
  const Joint& limits = robot_->description().joints[joint];
  const double tolerance = settings_.limit_tolerance;
  if (position >= limits.lower - tolerance && position <= limits.upper + tolerance) return;
  const bool is_low = position < limits.lower;
  const double limit = is_low ? limits.lower : limits.upper;
  ledger.add({.kind = Violation::Kind::kPositionLimit,
              .subject = limits.name,
              .other = limit_name(limits, is_low ? "lower limit" : "upper limit", limit, ""),
              .time_s = time_s,
              .amount = std::abs(position - limit)});
}

void FieldCheck::check_velocity(std::size_t joint, double velocity, double time_s,
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

void FieldCheck::check_acceleration(std::size_t joint, double acceleration, double noise,
                                    double time_s, ViolationLedger& ledger) const {
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

void FieldCheck::check_limits(const CubicMotion& motion, double from_s, double to_s,
                              ViolationLedger& ledger) const {
  if (settings_.obstacles_only) return;
  const double begin = from_s - motion.begin_s();
  const double end = to_s - motion.begin_s();
  const double piece_s = motion.duration_s();
  for (std::size_t j = 0; j < motion.joints().size(); ++j) {
    const Cubic& cubic = motion.joints()[j];
    const auto within = [&](double s) { return s > begin && s < end; };
    for (const double s : {begin, end}) {
      check_position(j, cubic.position(s), motion.begin_s() + s, ledger);
      check_velocity(j, cubic.velocity(s), motion.begin_s() + s, ledger);
      check_acceleration(j, cubic.acceleration(s),
                         kRounding * std::abs(cubic.q0) / piece_s / piece_s, motion.begin_s() + s,
                         ledger);
    }
    for (const double s : motion.turns(j)) {
      if (within(s)) check_position(j, cubic.position(s), motion.begin_s() + s, ledger);
    }
    const double s = cubic.inflection();
    if (within(s)) check_velocity(j, cubic.velocity(s), motion.begin_s() + s, ledger);
  }
}

void FieldCheck::check_state_limits(const Trajectory& trajectory, int state,
                                    ViolationLedger& ledger) const {
  if (settings_.obstacles_only) return;
  const double time_s = trajectory.times_s[idx(state)];
  for (std::size_t j = 0; j < static_cast<std::size_t>(trajectory.dof); ++j) {
    check_position(j, trajectory.q(state)[j], time_s, ledger);
    check_velocity(j, trajectory.qdot(state)[j], time_s, ledger);
  }
}

Error FieldCheck::late(const Trajectory& trajectory, double time_s) const {
  return Error{ErrorCode::kDeadlineExceeded,
               "the validity check ran out of time " + std::to_string(time_s) + " s into " +
                   std::to_string(trajectory.duration_s()) + " s of motion",
               {},
               {},
               nullptr};
}

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
