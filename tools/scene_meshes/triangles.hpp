#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace sidestep::scene_meshes {

/// A closed surface, facing outwards, in metres.
struct Triangles {
  std::vector<Eigen::Vector3d> vertices_m;
  std::vector<Eigen::Vector3i> faces;
};

/// As an OBJ file, millimetres rounded; `title` goes into its first line.
[[nodiscard]] std::string to_obj(const Triangles& mesh, const std::string& title);

// Organic shapes, as smooth unions of rounded cones (implicit_shapes.cpp). Feet at z = 0, facing x.
[[nodiscard]] Triangles cow();
[[nodiscard]] Triangles lady();
[[nodiscard]] Triangles armchair();

// Curved and thin shapes, as rings along a line (lofts.cpp). Feet at z = 0.
[[nodiscard]] Triangles vase();
[[nodiscard]] Triangles leaves();
[[nodiscard]] Triangles curtain();

/// The YAML of a camera path as a hand would carry it around the room, one waypoint a line.
[[nodiscard]] std::string handheld_path();

}  // namespace sidestep::scene_meshes
