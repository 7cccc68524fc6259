#pragma once

#include <memory>

#include <Eigen/Geometry>

#include <sidestep/core/time.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/tracks.hpp>

namespace sidestep {

/// The exact map of a scene at a time: what moves, as tracks, and the field of what does not, or of
/// all.
struct TrueMap {
  std::shared_ptr<const Tracks> tracks;
  std::shared_ptr<const DistanceField> field;
};

/// Half-spaces, which are floors, are left out. People that are there, and objects that move by
/// waypoints, each as the cylinder around all of it, with the velocity that it has. What has stood
/// for a second is an obstacle, and no track. Everything within `bounds_m` is known.
/// `masks_tracks`: the field is without what is tracked. Allocates. [any]
[[nodiscard]] TrueMap true_map(const Scene& scene, Stamp time, const Eigen::AlignedBox3d& bounds_m,
                               bool masks_tracks = true);

}  // namespace sidestep
