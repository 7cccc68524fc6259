#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {

/// Covers what rounding would leave bare.
inline constexpr double kRadiusMargin = 1.0 + 1e-9;

/// A sphere in a shape's frame.
struct Ball {
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
};

/// Balls that hold a bounded shape, each of which stands out from it by at most `protrusion_m`,
/// whatever its form; the same for the same input. Of a mesh that is not closed they hold the
/// triangles, from either side of which they stand out. Nothing where `most` balls are too few.
[[nodiscard]] std::optional<std::vector<Ball>> cover_solid(const Shape& shape, double protrusion_m,
                                                           std::size_t most);

}  // namespace sidestep
