#pragma once

#include <vector>

#include <Eigen/Core>

namespace sidestep::scene_meshes {

/// A closed surface, facing outwards, in metres.
struct Triangles {
  std::vector<Eigen::Vector3d> vertices_m;
  std::vector<Eigen::Vector3i> faces;
};

// Organic shapes, as smooth unions of rounded cones. Feet at z = 0, facing x.
[[nodiscard]] Triangles cow();
[[nodiscard]] Triangles lady();
[[nodiscard]] Triangles armchair();

// Curved and thin shapes, as rings along a line. Feet at z = 0.
[[nodiscard]] Triangles vase();
[[nodiscard]] Triangles leaves();
[[nodiscard]] Triangles curtain();

}  // namespace sidestep::scene_meshes
