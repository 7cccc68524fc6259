#pragma once

#include <cstddef>
#include <vector>

#include <sidestep/geometry/shape.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// A collision shape as a part of a rigid body.
struct BodyPart {
  int link = 0;
  Shape shape;
  Transform T_body_shape = Transform::Identity();
  Transform T_shape_body = Transform::Identity();
};

/// A link of a rigid body.
struct BodyLink {
  int link = 0;
  Transform T_body_link = Transform::Identity();
};

/// Links that no joint moves against each other, whether it is planned or not, and the bounded
/// shapes that they consist of, in the frame of the first of them: a sphere on one link covers the
/// shapes of the others, too.
struct RigidBody {
  std::vector<BodyLink> links;  ///< Parents before children.
  std::vector<BodyPart> parts;

  /// Null where the link belongs to another body.
  [[nodiscard]] const BodyLink* find(int link) const noexcept;
};

/// All bodies of a robot, those without shapes included. [any]; allocates.
[[nodiscard]] std::vector<RigidBody> rigid_bodies(const KinematicTree& robot);

/// To the nearest of the body's shapes: exact outside of them; inside minus the depth in the shape
/// in which the point lies deepest. Infinite without shapes. [any]
[[nodiscard]] double signed_distance_m(const RigidBody& body, const Eigen::Vector3d& p_body);

/// A sphere in the frame of a body.
struct BodySphere {
  int link = 0;
  Eigen::Vector3d p_body = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};
/// Those of the spheres that are on the body's links.
[[nodiscard]] std::vector<BodySphere> spheres_of(const RigidBody& body,
                                                 const std::vector<CollisionSphere>& spheres);

/// From the nearest of the spheres, negative within. Infinite without spheres. [any]
[[nodiscard]] double signed_distance_m(const std::vector<BodySphere>& spheres,
                                       const Eigen::Vector3d& p_body);

/// What fitted spheres are rounded to: a tenth of a millimetre is finer than any URDF.
inline constexpr double kGrainsPerMetre = 1e4;
inline constexpr double kGrain_m = 1.0 / kGrainsPerMetre;
/// To the nearest multiple, of which a decimal number with four digits is read.
[[nodiscard]] Eigen::Vector3d to_grain(const Eigen::Vector3d& p);
/// To the next multiple that is not smaller, to a nanometre.
[[nodiscard]] double up_to_grain(double radius_m);

/// The box that bounds a shape, in the shape's frame.
struct ShapeBounds {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_m = Eigen::Vector3d::Zero();
};
[[nodiscard]] ShapeBounds bounds_of(const Shape& shape);

/// A point of a shape's surface, and how much of it the point stands for.
struct SurfaceSample {
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  double area_m2 = 0.0;  ///< 0 for corners and rims, which are looked at apart.
};

/// About `count` points that lie evenly over the surface of a bounded shape, and its corners and
/// points of its rims. The same in every run. [any]; allocates.
[[nodiscard]] std::vector<SurfaceSample> surface_samples(const Shape& shape, std::size_t count);

/// The i-th of a sequence of points that fill the unit cube evenly, however many there are: the
/// additive recurrence of the generalised golden ratio (Roberts 2018). [any]
[[nodiscard]] Eigen::Vector3d even_in_cube(std::size_t i) noexcept;

/// `count` points that fill the unit ball evenly. [any]; allocates.
[[nodiscard]] std::vector<Eigen::Vector3d> even_in_ball(std::size_t count);

/// `count` unit vectors that cover the unit sphere evenly (Fibonacci's spiral). [any]; allocates.
[[nodiscard]] std::vector<Eigen::Vector3d> even_on_sphere(std::size_t count);

}  // namespace sidestep
