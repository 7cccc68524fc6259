#pragma once

#include <vector>

#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Spheres on the same link that cover a bounded shape and stand out from its bounding box by
/// at most `protrusion_m` where 64 spheres are enough for that. Along the axis of slender shapes,
/// on a grid otherwise; a mesh is covered by way of its bounding box. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT std::vector<CollisionSphere> fit_spheres(const CollisionShape& shape,
                                                                       double protrusion_m);

}  // namespace sidestep
