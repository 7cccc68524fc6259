#pragma once

#include <cstddef>
#include <vector>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {

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
