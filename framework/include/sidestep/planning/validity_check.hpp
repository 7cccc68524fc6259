#pragma once

#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// What a check calls the floor that a robot stands on.
inline constexpr const char* kFloorName = "the floor";
/// And a rolling base.
inline constexpr const char* kBaseName = "the base";

struct Violation {
  enum class Kind {
    kCollision,
    kSelfCollision,
    kPositionLimit,
    kVelocityLimit,
    kAccelerationLimit,
    kSideways,  ///< A rolling base moves across its wheels (RollingBase).
    kUnproven
  };
  Kind kind = Kind::kCollision;
  std::string subject;  ///< Link or joint.
  std::string other;    ///< What it hits or breaks: a link, "an obstacle", "the floor", "its upper
                        ///< limit of ...".
  double time_s = 0.0;  ///< Where it is worst.
  double amount = 0.0;  ///< By how much: penetration in m, beyond the limit in its unit, or m/s.

  /// E.g. "arm_roll_link is 0.013 m inside an obstacle".
  [[nodiscard]] std::string what() const;
  /// what() and when, e.g. "arm_roll_link is 0.013 m inside an obstacle at 2.35 s".
  [[nodiscard]] std::string describe() const;
};
[[nodiscard]] std::string_view to_string(Violation::Kind kind) noexcept;

struct Verdict {
  enum class Outcome {
    kValid,
    kInvalid,
    kUnproven,  ///< No violation was found, nor could the motion be shown to be free of any.
  };
  Outcome outcome = Outcome::kUnproven;
  double min_clearance_m = 0.0;  ///< Smallest at the times checked, the floor included; infinity
                                 ///< where there is nothing.
  /// min_clearance_m is a lower bound: the search range ended there.
  bool clearance_is_bound = false;
  std::string min_clearance_link;
  double min_clearance_time_s = 0.0;
  double min_self_clearance_m = 0.0;
  double unknown_share = 0.0;  ///< Share of sphere checks in space never seen or outside the map.
  /// That share of the link of which it is largest, of spheres that some joint moves.
  double most_unknown_share = 0.0;
  std::string most_unknown_link;      ///< Empty where no check is in such space.
  std::vector<Violation> violations;  ///< The worst of each subject and kind, worst first.
  /// When the first violation that was looked at is; infinity where there is none. One before it
  /// lasts for less than `max_step_m` of motion.
  double first_violation_s = std::numeric_limits<double>::infinity();

  [[nodiscard]] bool valid() const noexcept { return outcome == Outcome::kValid; }
  /// One sentence: "valid, 0.042 m clear", "valid, at least 0.5 m clear", or the first violations.
  [[nodiscard]] std::string describe() const;
};
[[nodiscard]] std::string_view to_string(Verdict::Outcome outcome) noexcept;

/// Decides whether a trajectory is safe, over continuous time. Immutable; [any] thread.
class SIDESTEP_EXPORT ValidityCheck {
 public:
  virtual ~ValidityCheck() = default;
  /// Checks from `from_s` to the end. Fails with kInvalidArgument for a malformed trajectory
  /// and kDeadlineExceeded; allocates.
  [[nodiscard]] virtual Result<Verdict> check(const Trajectory& trajectory, double from_s,
                                              const Deadline& deadline) const = 0;
};

struct FieldCheckSettings {
  double margin_m = 0.0;        ///< Clearance that spheres must keep.
  double max_step_m = 0.02;     ///< First spacing of checks, as sphere motion.
  double min_step_m = 1e-4;     ///< Bisection ends here with "unproven".
  double speed_fraction = 1.0;  ///< Velocity limits that must hold.
  /// Acceleration limits that must hold, where they are known; infinity checks none.
  double acceleration_fraction = std::numeric_limits<double>::infinity();
  double limit_tolerance =
      kLimitTolerance;  ///< Of positions, velocities and accelerations, in their units.
  /// End soon after the first violation: the verdict then tells of nothing later than 0.3 m of
  /// motion after it, nor, among exact shapes (SceneField) if it is valid, of clearances.
  bool first_violation_only = false;
  /// How long, from where a check begins, links keep to the policy's observed space.
  double observed_s = std::numeric_limits<double>::infinity();
  /// Look for collisions with the field alone: neither limits nor self-collision.
  bool obstacles_only = false;
};

/// The check on one pinned snapshot: the robot's spheres against the distance field, and
/// against each other, with bisection until the motion between two checks is proven clear
/// (numerics: continuous-time validity); limits from the extrema of the cubic interpolant; a
/// rolling base's speed, along its wheels and across them, at nine instants of each of its pieces.
///
/// A sphere's clearance is the field's value at its centre minus its radius, or the height of its
/// lowest point above the policy's floor where that is less. The field measures
/// from voxel centre to voxel centre, and what occupies a voxel may reach up to half its
/// diagonal beyond its centre: `margin_m` is what covers that; the independent check
/// (runtime/shape_check.hpp) sees whole voxels. The proof holds for every field whose values at
/// voxel centres are exact distances and whose status is one per voxel.
///
/// The outcome is kInvalid where a checked instant collides or a limit is broken, else kUnproven
/// where some motion could not be shown clear down to min_step_m, else kValid.
[[nodiscard]] std::unique_ptr<ValidityCheck> make_field_check(
    std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
    SpacePolicy space, FieldCheckSettings settings);

/// What is worst about one configuration (dof values): the deepest collision with field or floor
/// beyond `margin_m`, else the deepest self-collision, else the position limit that is broken
/// the most; nothing where all is well. Says why a start or a goal cannot be used. [any];
/// allocates.
[[nodiscard]] std::optional<Violation> state_violation(
    const std::shared_ptr<const RobotModel>& robot,
    const std::shared_ptr<const DistanceField>& field, const SpacePolicy& space, double margin_m,
    std::span<const double> q);

class MotionBounds;

/// make_field_check() and state_violation() for one robot in one map after the other: what they
/// need to know of the robot alone is worked out once. Immutable; [any].
class FieldChecks {
 public:
  explicit FieldChecks(std::shared_ptr<const RobotModel> robot);

  [[nodiscard]] const RobotModel* robot() const noexcept { return robot_.get(); }
  [[nodiscard]] std::unique_ptr<ValidityCheck> make(std::shared_ptr<const DistanceField> field,
                                                    SpacePolicy space,
                                                    FieldCheckSettings settings) const;
  [[nodiscard]] std::optional<Violation> state_violation(
      const std::shared_ptr<const DistanceField>& field, const SpacePolicy& space, double margin_m,
      std::span<const double> q) const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const MotionBounds> bounds_;
};

}  // namespace sidestep
