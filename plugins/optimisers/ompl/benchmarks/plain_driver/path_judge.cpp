#include "path_judge.hpp"

#include <algorithm>
#include <utility>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/runtime/shape_check.hpp>

namespace sidestep::plain_driver {
namespace {

/// Farther than an arm reaches.
constexpr double kReach_m = 3.0;

bool is_collision(const Violation& violation) {
  return violation.kind == Violation::Kind::kCollision ||
         violation.kind == Violation::Kind::kSelfCollision;
}

}  // namespace

PathJudge::PathJudge(std::shared_ptr<const RobotModel> robot, SpacePolicy space,
                     CheckSettings settings, bool with_shapes)
    : robot_(std::move(robot)),
      space_(std::move(space)),
      settings_(std::move(settings)),
      with_shapes_(with_shapes),
      checks_(robot_) {}

Result<PathVerdict> PathJudge::judge(const std::shared_ptr<const Scene>& scene,
                                     std::span<const double> path) const {
  const auto motion = SIDESTEP_TRY(time_path(robot_->description(), path, 1.0));
  const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(kReach_m);
  const auto field =
      std::make_shared<const SceneField>(*scene, Stamp(), Eigen::AlignedBox3d(-reach_m, reach_m));
  const auto check = checks_.make(
      field, space_, {.margin_m = settings_.margin_m, .max_step_m = settings_.max_step_m});
  const auto by_spheres = SIDESTEP_TRY(check->check(motion, 0.0, Deadline()));

  PathVerdict verdict;
  for (const Violation& violation : by_spheres.violations) {
    if (!is_collision(violation)) continue;
    verdict.is_in_collision = true;
    verdict.depth_m = std::max(verdict.depth_m, violation.amount);
  }
  if (by_spheres.outcome == Verdict::Outcome::kInvalid && !verdict.is_in_collision) {
    return fail(ErrorCode::kInternal, "a path breaks limits: " + by_spheres.describe());
  }
  verdict.is_unproven = !by_spheres.valid() && !verdict.is_in_collision;
  if (with_shapes_) {
    const auto shapes = SIDESTEP_TRY(by_shapes(scene, motion));
    verdict.is_touching = std::ranges::any_of(shapes.violations, is_collision);
  }
  return verdict;
}

Result<Verdict> PathJudge::by_shapes(const std::shared_ptr<const Scene>& scene,
                                     const Trajectory& motion) const {
  ShapeObstacles truth;
  truth.scene = scene;
  const auto check =
      SIDESTEP_TRY(make_shape_check(robot_, truth, {.max_step_m = settings_.shape_max_step_m}));
  return check->check(motion, 0.0, Deadline());
}

}  // namespace sidestep::plain_driver
