#pragma once

#include <memory>
#include <string_view>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep {

/// Full edge lengths, centred on the local origin.
struct Box {
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();
};
struct Sphere {
  double radius_m = 0.0;
};
/// Axis along local z, centred; `length_m` is the whole height.
struct Cylinder {
  double radius_m = 0.0;
  double length_m = 0.0;
};
/// Axis along local z, centred; `length_m` is between the centres of the two caps.
struct Capsule {
  double radius_m = 0.0;
  double length_m = 0.0;
};
/// The half-space z <= 0 of the local frame.
struct HalfSpace {};
class MeshIndex;

/// A triangle mesh; closed and outward-facing for signed distances to mean anything.
struct Mesh {
  std::vector<Eigen::Vector3d> vertices_m;
  std::vector<Eigen::Vector3i> triangles;
  /// Makes distances logarithmic in the number of triangles; from indexed_mesh(). Null: every
  /// triangle is visited.
  std::shared_ptr<const MeshIndex> index;
};

using Shape = std::variant<Box, Sphere, Cylinder, Capsule, HalfSpace, std::shared_ptr<const Mesh>>;

/// "box", "sphere", "cylinder", "capsule", "half_space" or "mesh".
[[nodiscard]] std::string_view shape_name(const Shape& shape) noexcept;

/// Exact signed Euclidean distance from a point in the shape's frame to its surface: negative
/// inside. A mesh gives the distance to its triangles, signed by the winding number,
/// whichever way they are wound. [any]
[[nodiscard]] double signed_distance_m(const Shape& shape, const Eigen::Vector3d& p_shape);

/// A mesh with the tree that signed_distance_m() searches. Scale and move vertices before.
[[nodiscard]] std::shared_ptr<const Mesh> indexed_mesh(Mesh mesh);

/// Reads a triangle mesh: STL (text and binary), OBJ and COLLADA (.dae; in metres by its unit, its
/// up axis as it is). Fails with kNotFound, kIo or kConfig, naming the file and, where it is text,
/// the line.
[[nodiscard]] Result<Mesh> read_mesh(const std::string& file);

/// Triangles that approximate a bounded shape, for ray casting and drawing. Curved surfaces
/// are inscribed with `segments` facets a turn. Empty for a half-space.
[[nodiscard]] Mesh triangulate(const Shape& shape, int segments = 48);

}  // namespace sidestep
