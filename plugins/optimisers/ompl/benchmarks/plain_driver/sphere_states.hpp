#pragma once

#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep::plain_driver {

/// A shape that stands still in the world.
template <class Kind>
struct PlacedShape {
  Kind shape;
  Transform T_shape_world;
  Eigen::Vector3d centre_m;  ///< In the world.
  double bound_m;            ///< Radius of a ball about it that holds the shape.
};

/// Whether single configurations are free: each sphere of a robot against each shape of a scene
/// that stands still, then spheres of links against those of others. Plain, but not slow: boxes,
/// cylinders and balls by squared distances, after a look at the balls that hold them. One thread
/// at a time; no allocation once warm.
class SphereStates {
 public:
  /// `margin_m`: clearance that spheres must keep from shapes.
  SphereStates(std::shared_ptr<const RobotModel> robot, const Scene& scene, double margin_m);

  /// q: dof values. Limits are the caller's affair.
  [[nodiscard]] bool is_free(std::span<const double> q);

 private:
  /// Two spheres that must not touch.
  struct Pair {
    std::size_t first;
    std::size_t second;
    double reach_m;  ///< Sum of their radii.
  };

  void place(const Shape& shape, const Transform& T_world_shape);
  [[nodiscard]] bool is_clear_of_shapes() const;
  [[nodiscard]] bool is_clear_of_itself() const;

  std::shared_ptr<const RobotModel> robot_;
  std::vector<PlacedShape<Box>> boxes_;
  std::vector<PlacedShape<Cylinder>> cylinders_;
  std::vector<PlacedShape<Sphere>> balls_;
  std::vector<PlacedShape<Shape>> others_;
  std::vector<Pair> pairs_;
  double margin_m_;
  std::vector<Eigen::Vector3d> centres_m_;
  Scratch scratch_;
};

}  // namespace sidestep::plain_driver
