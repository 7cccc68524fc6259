#include <sidestep/core/index.hpp>
#include <sidestep/planning/validity_check.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>

#include "clearance_prover.hpp"

namespace sidestep {
namespace {

constexpr std::size_t kDescribed = 3;

std::string metres(double value) { return format("%.3f m", value); }

bool is_worse(const Violation& a, const Violation& b) {
  if (a.kind != b.kind) return a.kind < b.kind;
  return a.amount > b.amount;
}

const std::string& link_name(const RobotDescription& robot, int link) {
  return robot.links[idx(link)].name;
}

void name_pair(const ClearanceProver& prover, int item, Violation& violation) {
  const RobotDescription& robot = prover.robot().description();
  const auto [first, second] = robot.self_collision_pairs[idx(item - prover.sphere_count())];
  violation.subject = link_name(robot, second);
  violation.other = link_name(robot, first);
}

}  // namespace

std::string_view to_string(Violation::Kind kind) noexcept {
  switch (kind) {
    case Violation::Kind::kCollision: return "collision";
    case Violation::Kind::kSelfCollision: return "self_collision";
    case Violation::Kind::kPositionLimit: return "position_limit";
    case Violation::Kind::kVelocityLimit: return "velocity_limit";
    case Violation::Kind::kAccelerationLimit: return "acceleration_limit";
    case Violation::Kind::kSideways: return "sideways";
    case Violation::Kind::kUnproven: return "unproven";
  }
  return "unproven";
}

std::string_view to_string(Verdict::Outcome outcome) noexcept {
  switch (outcome) {
    case Verdict::Outcome::kValid: return "valid";
    case Verdict::Outcome::kInvalid: return "invalid";
    case Verdict::Outcome::kUnproven: return "unproven";
  }
  return "unknown";
}

std::string Violation::what() const {
  switch (kind) {
    case Kind::kCollision:
    case Kind::kSelfCollision:
      return subject + " is " + metres(amount) + (other == kFloorName ? " below " : " inside ") +
             (other.empty() ? "an obstacle" : other);
    case Kind::kPositionLimit:
    case Kind::kVelocityLimit:
    case Kind::kAccelerationLimit:
      return subject + " is " + format("%.3g", amount) + " beyond " +
             (other.empty() ? "its limit" : other);
    case Kind::kSideways:
      return subject + " moves across its wheels at " + format("%.3g m/s", amount);
    case Kind::kUnproven:
      return subject + " could not be shown clear of " + (other.empty() ? "obstacles" : other);
  }
  return subject;
}

std::string Violation::describe() const { return what() + format(" at %.2f s", time_s); }

std::string Verdict::describe() const {
  if (valid()) {
    if (!std::isfinite(min_clearance_m)) return "valid, nothing near";
    const std::string least = clearance_is_bound ? "at least " : "";
    return "valid, " + least + metres(min_clearance_m) + " clear";
  }
  std::string text = outcome == Outcome::kInvalid ? "invalid" : "not shown to be valid";
  for (std::size_t i = 0; i < std::min(kDescribed, violations.size()); ++i) {
    text += (i == 0 ? ": " : "; ") + violations[i].describe();
  }
  if (violations.size() > kDescribed) {
    text += "; and " + std::to_string(violations.size() - kDescribed) + " more";
  }
  return text;
}

void ViolationLedger::add(Violation violation) {
  first_s_ = std::min(first_s_, violation.time_s);
  for (Violation& known : violations_) {
    if (known.kind != violation.kind || known.subject != violation.subject) continue;
    if (is_worse(violation, known)) known = std::move(violation);
    return;
  }
  violations_.push_back(std::move(violation));
}

void ViolationLedger::check_position(const Joint& joint, double tolerance, double position,
                                     double time_s) {
  if (position >= joint.lower - tolerance && position <= joint.upper + tolerance) return;
  const bool is_low = position < joint.lower;
  const double limit = is_low ? joint.lower : joint.upper;
  add({.kind = Violation::Kind::kPositionLimit,
       .subject = joint.name,
       .other = limit_name(joint, is_low ? "lower limit" : "upper limit", limit, ""),
       .time_s = time_s,
       .amount = std::abs(position - limit)});
}

std::vector<Violation> ViolationLedger::sorted() const {
  std::vector<Violation> sorted = violations_;
  std::stable_sort(sorted.begin(), sorted.end(), is_worse);
  return sorted;
}

std::string obstacle_name(FieldStatus status, const SpacePolicy& space) {
  if (status == FieldStatus::kOutside) return "the space outside the map";
  const bool is_unseen = status == FieldStatus::kUnknown && space.unknown == Space::kOccupied;
  return is_unseen ? kUnknownSpace : kObstacle;
}

Violation violation_of(const ClearanceProver& prover, int item, const ClearanceReading& reading,
                       double time_s) {
  const RobotDescription& robot = prover.robot().description();
  Violation violation;
  violation.time_s = time_s;
  violation.amount = prover.required_m(item) - reading.clearance_m;
  if (item >= prover.sphere_count()) {
    violation.kind = Violation::Kind::kSelfCollision;
    name_pair(prover, item, violation);
    return violation;
  }
  violation.kind = Violation::Kind::kCollision;
  violation.subject = link_name(robot, robot.spheres[idx(item)].link);
  const bool is_floor = reading.floor_m <= reading.clearance_m;
  violation.other = is_floor            ? kFloorName
                    : reading.is_unseen ? kUnknownSpace
                                        : obstacle_name(reading.status, prover.space());
  if (!is_floor && violation.other != kObstacle) return violation;
  if (reading.clearance_m >= 0.0) {
    violation.other = "the margin of " + violation.other;
  } else {
    violation.amount = -reading.clearance_m;
  }
  return violation;
}

Violation unproven(const ClearanceProver& prover, int item, const Shortfall& shortfall,
                   double time_s) {
  const RobotDescription& robot = prover.robot().description();
  Violation violation;
  violation.kind = Violation::Kind::kUnproven;
  violation.time_s = time_s;
  violation.amount = shortfall.amount_m;
  if (item >= prover.sphere_count()) {
    name_pair(prover, item, violation);
  } else {
    violation.subject = link_name(robot, robot.spheres[idx(item)].link);
    violation.other = shortfall.is_to_floor ? kFloorName : "obstacles";
  }
  return violation;
}

std::string limit_name(const Joint& joint, std::string_view which, double value,
                       std::string_view per) {
  return "its " + std::string(which) + " of " + format("%.4g ", value) + joint.unit() +
         std::string(per);
}

std::optional<Violation> state_violation(const std::shared_ptr<const RobotModel>& robot,
                                         const std::shared_ptr<const DistanceField>& field,
                                         const SpacePolicy& space, double margin_m,
                                         std::span<const double> q) {
  return FieldChecks(robot).state_violation(field, space, margin_m, q);
}

FieldChecks::FieldChecks(std::shared_ptr<const RobotModel> robot)
    : robot_(std::move(robot)), bounds_(std::make_shared<const MotionBounds>(*robot_)) {}

std::optional<Violation> FieldChecks::state_violation(
    const std::shared_ptr<const DistanceField>& field, const SpacePolicy& space, double margin_m,
    std::span<const double> q) const {
  const std::vector<Joint>& joints = robot_->description().joints;
  ViolationLedger ledger;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const double position = j < q.size() ? q[j] : std::nan("");
    ledger.check_position(joints[j], kLimitTolerance, position, 0.0);
    if (!std::isfinite(position)) return ledger.sorted().front();
  }
  const ClearanceProver prover(robot_, bounds_, field, space, margin_m);
  const auto workspace = prover.make_workspace();
  std::vector<ClearanceReading> readings(idx(prover.item_count()));
  prover.read(q, readings, *workspace);
  for (int item = 0; item < prover.item_count(); ++item) {
    const ClearanceReading& reading = readings[idx(item)];
    if (prover.violates(item, reading)) ledger.add(violation_of(prover, item, reading, 0.0));
  }
  if (ledger.empty()) return std::nullopt;
  return ledger.sorted().front();
}

}  // namespace sidestep
