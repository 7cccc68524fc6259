#pragma once

#include <memory>
#include <span>

#include <sidestep/core/export.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Shows straight motions in joint space clear on one snapshot, for planners that join
/// configurations: the robot's spheres against the field and against each other, over the
/// whole motion, by the same proof as the field check; among the shapes themselves (SceneField)
/// in lanes of configurations, which is many times faster. Keeps its temporaries: one object per
/// thread; no allocation once warm.
class SIDESTEP_EXPORT MotionCheck {
 public:
  /// `margin_m`: clearance that spheres must keep (see make_field_check).
  MotionCheck(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
              SpacePolicy space, double margin_m);
  ~MotionCheck();
  MotionCheck(MotionCheck&&) noexcept;
  MotionCheck& operator=(MotionCheck&&) noexcept;

  /// The same robot on another snapshot. What is known of the robot alone is kept. Allocates.
  void look_at(std::shared_ptr<const DistanceField> field, SpacePolicy space, double margin_m);

  /// True if one configuration (dof values) is clear. Limits are the caller's affair.
  [[nodiscard]] bool is_clear(std::span<const double> q);

  /// Of at most kLanes configurations, one after the other in `q` (n x dof values), those that are
  /// not clear: bit i for configuration i. What is not finite is not clear. Among shapes in lanes.
  [[nodiscard]] unsigned find_blocked(std::span<const double> q);

  /// True if the straight line between two configurations is shown to be clear, ends included.
  /// A motion that cannot be shown clear before no sphere moves more than `resolution_m`
  /// between checks counts as blocked, so nothing is ever called clear that is not.
  [[nodiscard]] bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                              double resolution_m);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
