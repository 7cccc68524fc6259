#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/geometry/people.hpp>
#include <sidestep/geometry/shape.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// Where a moving object is at one time.
struct Waypoint {
  double time_s = 0.0;
  Transform T_world_object = Transform::Identity();
};

/// How an object's motion differs from one drawing of a scene to the next. Each number is drawn
/// evenly from its range.
struct MotionRanges {
  struct Range {
    double lower = 0.0;
    double upper = 0.0;
  };
  Range delay_s;          ///< Added to the waypoints' times; below zero: the motion has begun.
  Range speed{1.0, 1.0};  ///< Factor, greater than 0.
  std::array<Range, 3> offset_m;  ///< Added to all positions: x, y, z.
};

/// A shape somewhere in the world. One waypoint: it stands still. Several: it moves along
/// them, linear in position and slerp in orientation, and rests before the first and after
/// the last; with `repeat` it starts again from the first once the last is reached.
struct SceneObject {
  std::string name;
  Shape shape;
  std::vector<Waypoint> waypoints;  ///< At least one; times strictly increasing.
  bool repeat = false;
  std::optional<MotionRanges> random;  ///< Not drawn yet.
  int person = -1;                     ///< Index of the person whose part it is; -1: of none.

  [[nodiscard]] bool moves() const noexcept { return waypoints.size() > 1; }
  [[nodiscard]] Transform T_world_object(double time_s) const;
};

struct SceneDistance {
  double distance_m = 0.0;  ///< Negative inside an object; infinity in an empty scene.
  int object = -1;          ///< Index of the nearest object; -1 in an empty scene.
};

/// A world whose geometry is known exactly: what simulated cameras see, and what results are
/// measured against. Immutable after construction, so safe to share. [any]
class Scene {
 public:
  Scene() = default;
  explicit Scene(std::vector<SceneObject> objects) : objects_(std::move(objects)) {}
  Scene(std::vector<SceneObject> objects, People people)
      : objects_(std::move(objects)), people_(std::move(people)) {}

  [[nodiscard]] const std::vector<SceneObject>& objects() const noexcept { return objects_; }
  [[nodiscard]] const People& people() const noexcept { return people_; }

  /// This scene with what is random drawn, by a seed and the names of objects and people. The
  /// people that are not given are drawn, each with a body among the objects, where it starts
  /// (crowd.hpp has them walk). Fails with kConfig where there is no room for one, and where one
  /// starts inside an object.
  [[nodiscard]] Result<Scene> drawn(std::uint64_t seed) const;

  /// Exact signed distance to the union of the objects as it is outside them; inside, the
  /// deepest single object's distance.
  [[nodiscard]] SceneDistance signed_distance(const Eigen::Vector3d& p_world, double time_s) const;

 private:
  std::vector<SceneObject> objects_;
  People people_;
};

/// Reads a scene (docs/reference/scenes.md). All mistakes in one pass, each a kConfig error
/// at its position.
struct SceneReading {
  Scene scene;
  std::vector<Error> errors;
};
[[nodiscard]] SceneReading read_scene(const Node& document);

}  // namespace sidestep
