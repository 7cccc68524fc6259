#pragma once

#include <memory>

#include <Eigen/Geometry>

#include <sidestep/core/time.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/tracks.hpp>

namespace sidestep {

/// A map as nobody can see it: what moves in a scene at a time, as tracks, and the exact field of
/// what does not.
struct TrueMap {
  std::shared_ptr<const Tracks> tracks;
  std::shared_ptr<const DistanceField> field;
};

/// Half-spaces, which are floors, are left out. People that are there, and objects that move by
/// waypoints, each as the cylinder around all of it, with the velocity that it has; everything
/// within `bounds_m` is known. Allocates. [any]
[[nodiscard]] TrueMap true_map(const Scene& scene, Stamp time, const Eigen::AlignedBox3d& bounds_m);

}  // namespace sidestep
