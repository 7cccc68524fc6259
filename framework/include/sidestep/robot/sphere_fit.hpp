#pragma once

#include <array>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Limit per shape.
inline constexpr int kMostFittedSpheres = 2000;

/// Spheres on the same link that cover a bounded shape, each of which stands out from the shape's
/// surface by at most `protrusion_m`: along the axis of slender shapes, on a grid over boxes, else
/// wherever one sphere holds the most. A mesh that is closed is covered with what it encloses, any
/// other is covered as a surface that has two outer sides. Fails with kInvalidArgument where
/// kMostFittedSpheres are too few. [any]; allocates; up to a second.
[[nodiscard]] SIDESTEP_EXPORT Result<std::vector<CollisionSphere>> fit_spheres(
    const CollisionShape& shape, double protrusion_m);

/// Both halves across its longest side of a box with centre `p_shape` and `half_m`. [any]
template <class Cell>
[[nodiscard]] std::array<Cell, 2> halves(const Cell& cell) {
  int longest = 0;
  cell.half_m.maxCoeff(&longest);
  Cell low = cell;
  low.half_m[longest] *= 0.5;
  Cell high = low;
  low.p_shape[longest] -= low.half_m[longest];
  high.p_shape[longest] += high.half_m[longest];
  return {low, high};
}

}  // namespace sidestep
