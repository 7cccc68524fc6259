#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/lanes.hpp>
#include <sidestep/geometry/scene.hpp>

namespace sidestep::detail {

/// A shape where it stands, in the numbers that kernels want.
struct Solid {
  enum class Kind { kBox, kSphere, kCylinder, kCapsule, kHalfSpace, kMesh };

  Kind kind = Kind::kBox;
  Eigen::Matrix3d R_world_shape = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_world_shape = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_m = Eigen::Vector3d::Zero();  ///< Of a box: half of its edges.
  bool is_aligned = false;                           ///< R is the identity.
  double radius_m = 0.0;
  double half_length_m = 0.0;  ///< Of a cylinder, and between the centres of a capsule's caps.
  /// Around its place, holds all of it; infinity where nothing does.
  double reach_m = 0.0;
  std::shared_ptr<const Mesh> mesh;
};

[[nodiscard]] Solid make_solid(const SceneObject& object, double time_s);

/// The unit vector along which the distance from a point grows fastest.
[[nodiscard]] Eigen::Vector3d gradient_of(const Solid& solid, const Eigen::Vector3d& p_world);

/// A mesh's, point by point.
[[nodiscard]] double mesh_distance_m(const Solid& solid, const Eigen::Vector3d& p_world);

/// Boxes around kLanes solids in a row; where there are fewer, the last ones hold nothing.
struct SolidBounds {
  PointLanes low_m, high_m;
};
[[nodiscard]] std::vector<SolidBounds> bounds_of(std::span<const Solid> solids);

/// The nearest of some solids, none of them a mesh, to each of kLanes points: where one is nearer
/// than distances_m says, its distance and its number are written. Only those are looked at whose
/// bounds come within `limit_m` of the points, none of whose distances may be greater.
void find_nearest_solids(const Solid* solids, std::span<const SolidBounds> bounds,
                         const PointLanes& points_m, double limit_m, double* distances_m,
                         double* numbers) noexcept;

/// Numbers of the solids whose bounds come within `limit_m` of some of kLanes points, for which
/// there is room. Returns how many.
std::size_t find_solids_beside(std::span<const SolidBounds> bounds, const PointLanes& points_m,
                               double limit_m, std::uint32_t* beside) noexcept;

/// Of the solids with these numbers, none of them a mesh, those that come nearer than its limit
/// (positive) to any of kLanes points: their numbers, for which there is room; it may be that of
/// `numbers`. is_near[lane] becomes 1 where any is, and is left alone elsewhere. Takes no roots
/// where it need not. Returns how many.
std::size_t find_solids_within(const Solid* solids, const std::uint32_t* numbers, std::size_t count,
                               const PointLanes& points_m, const double* limits_m,
                               std::uint32_t* near, double* is_near) noexcept;

}  // namespace sidestep::detail
