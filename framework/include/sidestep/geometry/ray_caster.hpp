#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include <sidestep/geometry/scene.hpp>

namespace sidestep {

struct RayHit {
  double distance_m = 0.0;  ///< Along the (unit) direction; infinity without a hit.
  int object = -1;
  Eigen::Vector3d normal_world = Eigen::Vector3d::Zero();  ///< Unit length, towards the ray.
};

/// Casts rays into a scene with Embree; curved shapes are cast exactly, not as facets. A ray
/// that starts inside an object hits that object's surface from within. Keeps its own copy of
/// the scene. The constructor throws std::runtime_error where Embree cannot start.
/// set_time() and set_poses() are [simulation] only and must not run beside the casts, which are
/// [any].
class RayCaster {
 public:
  explicit RayCaster(const Scene& scene);
  ~RayCaster();
  RayCaster(RayCaster&&) noexcept;
  RayCaster& operator=(RayCaster&&) noexcept;

  /// Moves the objects to where they are at `time_s`.
  void set_time(double time_s);

  /// Moves objects that stand still in the scene, from number `first` on, to the given poses.
  void set_poses(std::size_t first, std::span<const Transform> T_world_object);

  /// The first hit of each ray; origins and unit directions in the world frame. All three
  /// spans have the same length. Does not allocate.
  void cast(std::span<const Eigen::Vector3d> origins, std::span<const Eigen::Vector3d> directions,
            std::span<RayHit> hits) const;

  /// Only how far rays of one origin go, as those of a camera, in metres; infinity without a hit.
  /// Origin and unit directions in the world frame; both spans have the same length. Faster than
  /// cast() where neighbours in the span go nearly the same way and the scene has no meshes. Does
  /// not allocate.
  void cast_distances(const Eigen::Vector3d& origin, std::span<const Eigen::Vector3d> directions,
                      std::span<double> distances_m) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
