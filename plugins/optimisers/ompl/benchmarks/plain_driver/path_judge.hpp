#pragma once

#include <memory>
#include <span>

#include <sidestep/core/error.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep::plain_driver {

struct PathVerdict {
  bool is_in_collision = false;  ///< A sphere is in an obstacle or in another link's, somewhere.
  bool is_unproven = false;      ///< Neither that, nor shown to be clear.
  double depth_m = 0.0;          ///< Of the deepest collision that was looked at.
  /// The same by the shapes of the URDF, if they were asked for.
  bool is_touching = false;
};

/// What a path is worth over all of its length: the framework's own checks (make_field_check,
/// make_shape_check) of a motion that stops at its vertices, straight in between. [any]
class PathJudge {
 public:
  /// `with_shapes`: by FCL, too, which takes a quarter of a second a path.
  PathJudge(std::shared_ptr<const RobotModel> robot, SpacePolicy space, CheckSettings settings,
            bool with_shapes);

  /// path: n x dof, row by row. Fails where the path cannot be timed, breaks limits, or a check
  /// fails.
  [[nodiscard]] Result<PathVerdict> judge(const std::shared_ptr<const Scene>& scene,
                                          std::span<const double> path) const;

 private:
  [[nodiscard]] Result<Verdict> by_shapes(const std::shared_ptr<const Scene>& scene,
                                          const Trajectory& motion) const;

  std::shared_ptr<const RobotModel> robot_;
  SpacePolicy space_;
  CheckSettings settings_;
  bool with_shapes_;
  FieldChecks checks_;
};

}  // namespace sidestep::plain_driver
