#pragma once

#include <stop_token>
#include <vector>

#include "rigid_body.hpp"

namespace sidestep {

/// Spheres of one link that hold one of its shapes completely.
struct ShapeCover {
  std::vector<BodySphere> spheres;
  double protrusion_m = 0.0;  ///< How far they stand out from the shapes of the body, at most.
  double excess_m3 = 0.0;     ///< What of their union lies outside of the shapes of the body.
};

/// Covers of a shape with ever more spheres, each with less excess than all with fewer spheres:
/// stacks along the axis of a cylinder, of single spheres and of rings, grids over a box, rows
/// along a capsule, clusters of a mesh. `most_spheres` in the largest. [any]; allocates.
[[nodiscard]] std::vector<ShapeCover> shape_covers(const RigidBody& body, const BodyPart& part,
                                                   int most_spheres, const std::stop_token& stop);

}  // namespace sidestep
