#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "rigid_body.hpp"

namespace sidestep {

/// A box of a shape's, along the axes of the shape's frame, that holds some of the shape.
struct Cell {
  int part = 0;  ///< Index into RigidBody::parts.
  Eigen::Vector3d p_shape = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_m = Eigen::Vector3d::Zero();
};

/// What of a body is held already, when spheres for one of its links are looked for.
struct Held {
  std::vector<BodySphere> spheres;
  std::vector<int> links;  ///< Whose shapes are held completely.
};

/// A link's shapes as boxes that hold all of them: fine at the surface, coarse in the depth.
/// Spheres that hold every box hold the shapes, not only at samples. Left out are boxes that are
/// held already. Halved until their half diagonal is at most `fine_m`, deeper ones some of the
/// depth; at most `most` boxes, and coarser where that is too few. [any]; allocates.
[[nodiscard]] std::vector<Cell> link_cells(const RigidBody& body, int link, const Held& held,
                                           double fine_m, std::size_t most);

/// From a point to the farthest corner of a box; the point in the shape's frame.
[[nodiscard]] inline double farthest_m(const Cell& cell, const Eigen::Vector3d& p_shape) noexcept {
  return ((p_shape - cell.p_shape).cwiseAbs() + cell.half_m).norm();
}

/// How large a sphere must be to hold what of the shapes lies in these boxes: as the farthest
/// corner says, or less, since boxes at curved surfaces are halved further where that helps.
/// [any]; allocates.
[[nodiscard]] double radius_to_hold_m(const RigidBody& body, std::span<const Cell> cells,
                                      const Eigen::Vector3d& p_body);

}  // namespace sidestep
