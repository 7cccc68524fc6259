#include "checker.hpp"

#include <utility>
#include <vector>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/motion_check.hpp>

#include "shape_paths.hpp"

namespace sidestep::joint_paths {
namespace {

/// Clearance kept beyond the problem's margin, so that whatever is shown clear here can be
/// shown clear again by a check with other steps.
constexpr double kSpareMargin_m = 2e-4;
/// The same where shapes are judged again by FCL, whose distances err by 1e-5 m and whose steps
/// near obstacles are up to 5e-4 m long: it needs half of that at both ends of one.
constexpr double kSpareShapeMargin_m = 3e-4;

/// The robot's spheres against the field.
class FieldChecker final : public Checker {
 public:
  Result<void> look_at(const Problem& problem) override {
    field_ = problem.field;
    space_ = problem.space;
    margin_m_ = problem.collision_margin_m + kSpareMargin_m;
    // What is known of a robot is kept from problem to problem.
    if (check_ && robot_ == problem.robot) {
      check_->look_at(field_, space_, margin_m_);
    } else {
      robot_ = problem.robot;
      check_.emplace(robot_, field_, space_, margin_m_);
    }
    return {};
  }
  bool is_clear(std::span<const double> q) override { return check_->is_clear(q); }
  unsigned find_blocked(std::span<const double> q) override { return check_->find_blocked(q); }
  bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                double resolution_m) override {
    return check_->is_clear(q_from, q_to, resolution_m);
  }
  std::optional<Violation> violation(std::span<const double> q) override {
    return state_violation(robot_, field_, space_, margin_m_, q);
  }

 private:
  std::shared_ptr<const RobotModel> robot_;  ///< Of check_.
  std::shared_ptr<const DistanceField> field_;
  SpacePolicy space_;
  double margin_m_ = 0.0;
  std::optional<MotionCheck> check_;
};

/// What the policy says of the floor becomes an object of the scene.
void add_floor_object(const Floor& floor, ShapeWorld& world) {
  std::vector<SceneObject> objects;
  if (world.obstacles.scene) objects = world.obstacles.scene->objects();
  SceneObject plane;
  plane.name = "the floor";
  plane.shape = HalfSpace{};
  plane.waypoints.resize(1);
  plane.waypoints[0].T_world_object.translation().z() = floor.height_m;
  for (const std::string& link : floor.except_links) world.allowed.push_back({link, plane.name});
  objects.push_back(std::move(plane));
  world.obstacles.scene = std::make_shared<const Scene>(std::move(objects));
}

bool is_same(const SpacePolicy& a, const SpacePolicy& b) {
  if (a.unknown != b.unknown || a.outside != b.outside) return false;
  if (!a.floor || !b.floor) return a.floor.has_value() == b.floor.has_value();
  return a.floor->height_m == b.floor->height_m && a.floor->except_links == b.floor->except_links;
}

/// The shapes of the robot's URDF against those of a scene, or against an octree, by FCL.
class ShapeChecker final : public Checker {
 public:
  explicit ShapeChecker(bool in_octree) : in_octree_(in_octree) {}

  Result<void> look_at(const Problem& problem) override {
    const RobotDescription& robot = problem.robot->description();
    if (robot.shapes.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  std::string("checker: ") + (in_octree_ ? "octomap" : "primitives") +
                      " looks at the robot's collision shapes, and " + robot.name + " has none",
                  {}, "use checker: field, or give its links <collision> elements in the URDF");
    }
    if (paths_ && is_looked_at(problem)) return {};
    ShapeWorld world;
    SIDESTEP_TRY(in_octree_ ? fill_octree(problem, world) : fill_scene(problem, world));
    world.margin_m = problem.collision_margin_m + kSpareShapeMargin_m;
    world.self_margin_m = kSpareShapeMargin_m;
    if (problem.space.floor) add_floor_object(*problem.space.floor, world);
    if (problem.space.outside == Space::kOccupied) {
      const GridSpec& grid = problem.field->info().grid;
      world.bounds_m.emplace(grid.origin_m, grid.upper_m());
    }
    paths_.emplace(problem.robot, std::move(world));
    robot_ = problem.robot;
    field_ = problem.field;
    space_ = problem.space;
    margin_m_ = problem.collision_margin_m;
    return {};
  }
  bool is_clear(std::span<const double> q) override { return paths_->is_clear(q); }
  unsigned find_blocked(std::span<const double>) override { return 0; }
  bool is_clear(std::span<const double> q_from, std::span<const double> q_to,
                double resolution_m) override {
    return paths_->is_clear(q_from, q_to, resolution_m);
  }
  std::optional<Violation> violation(std::span<const double> q) override {
    return paths_->violation(q);
  }

 private:
  static Result<void> fill_scene(const Problem& problem, ShapeWorld& world) {
    const auto* scene = dynamic_cast<const SceneField*>(problem.field.get());
    if (scene == nullptr) {
      return fail(ErrorCode::kInvalidArgument,
                  "checker: primitives wants the shapes of a scene, and this problem has a map", {},
                  "use checker: field or checker: octomap");
    }
    world.obstacles.scene = scene->scene();
    return {};
  }
  static Result<void> fill_octree(const Problem& problem, ShapeWorld& world) {
    if (problem.field->info().is_exact) {
      return fail(ErrorCode::kInvalidArgument,
                  "checker: octomap wants a map of voxels, and this problem has the shapes of a "
                  "scene",
                  {}, "use checker: field or checker: primitives");
    }
    world.obstacles.voxels_in_octree = true;
    world.obstacles.resolution_m = problem.field->info().grid.resolution_m;
    world.obstacles.occupied_centres_m = occupied_centres(*problem.field, problem.space.unknown);
    return {};
  }

  /// An octree takes far longer to build than most searches: for the same map there is one.
  [[nodiscard]] bool is_looked_at(const Problem& problem) const {
    return robot_ == problem.robot && field_ == problem.field &&
           margin_m_ == problem.collision_margin_m && is_same(space_, problem.space);
  }

  bool in_octree_;
  std::optional<ShapePaths> paths_;
  // What they are about.
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const DistanceField> field_;
  SpacePolicy space_;
  double margin_m_ = 0.0;
};

}  // namespace

std::unique_ptr<Checker> make_checker(const std::string& name) {
  if (name == "field") return std::make_unique<FieldChecker>();
  return std::make_unique<ShapeChecker>(name == "octomap");
}

}  // namespace sidestep::joint_paths
