#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "triangles.hpp"

namespace sidestep::scene_meshes {
namespace {

using Vector = Eigen::Vector3d;

/// An ellipse in space: its centre and two half axes.
struct Ring {
  Vector centre, u, v;
};

/// Adds the closed surface through rings of `corners` corners each, with a cap on either end. Seen
/// from its end, the line of centres comes towards the eye and u to v turns anticlockwise.
void add_loft(Triangles& mesh, const std::vector<Ring>& rings, int corners) {
  const int first = static_cast<int>(mesh.vertices_m.size());
  for (const Ring& ring : rings) {
    for (int i = 0; i < corners; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / corners;
      mesh.vertices_m.emplace_back(ring.centre + std::cos(angle) * ring.u +
                                   std::sin(angle) * ring.v);
    }
  }
  const int bottom = static_cast<int>(mesh.vertices_m.size());
  mesh.vertices_m.push_back(rings.front().centre);
  mesh.vertices_m.push_back(rings.back().centre);
  const int last = first + corners * (static_cast<int>(rings.size()) - 1);
  for (int i = 0; i < corners; ++i) {
    const int next = (i + 1) % corners;
    for (int ring = first; ring < last; ring += corners) {
      mesh.faces.emplace_back(ring + i, ring + next, ring + corners + next);
      mesh.faces.emplace_back(ring + i, ring + corners + next, ring + corners + i);
    }
    mesh.faces.emplace_back(bottom, first + next, first + i);
    mesh.faces.emplace_back(bottom + 1, last + i, last + next);
  }
}

}  // namespace

Triangles vase() {
  constexpr std::array kRadii_m = {0.07,  0.10, 0.13, 0.145, 0.14, 0.115,
                                   0.085, 0.06, 0.05, 0.055, 0.075};
  std::vector<Ring> rings;
  double z = 0.0;
  for (const double radius_m : kRadii_m) {
    rings.push_back({{0, 0, z}, {radius_m, 0, 0}, {0, radius_m, 0}});
    z += 0.045;
  }
  Triangles mesh;
  add_loft(mesh, rings, 24);
  return mesh;
}

Triangles leaves() {
  constexpr int kLeaves = 9;
  constexpr int kRings = 12;
  Triangles mesh;
  for (int leaf = 0; leaf < kLeaves; ++leaf) {
    const double turn = 2.0 * std::numbers::pi * leaf / kLeaves + 0.3 * (leaf % 2);
    const double length_m = 0.55 + 0.12 * (leaf % 3);
    const Vector out(std::cos(turn), std::sin(turn), 0.0);
    const Vector across(-std::sin(turn), std::cos(turn), 0.0);
    std::vector<Ring> rings;
    for (int i = 0; i < kRings; ++i) {
      // Upwards at first, then bending over.
      const double s = static_cast<double>(i) / (kRings - 1);
      const double bend = 0.25 + 1.5 * s;
      const Vector along = std::sin(bend) * out + std::cos(bend) * Vector::UnitZ();
      const Vector centre = rings.empty()
                                ? Vector(0.02 * out)
                                : Vector(rings.back().centre + length_m / (kRings - 1) * along);
      const double half_width_m =
          0.008 + 0.05 * std::sin(std::numbers::pi * std::min(1.0, 0.15 + 0.85 * s));
      rings.push_back({centre, half_width_m * across, 0.004 * along.cross(across).normalized()});
    }
    add_loft(mesh, rings, 8);
  }
  return mesh;
}

Triangles curtain() {
  // Cloth 1 cm thick that hangs in waves along x, 1.6 m wide and 2.1 m high.
  constexpr int kColumns = 81;
  constexpr double kWidth_m = 1.6, kHeight_m = 2.1, kHalfThickness_m = 0.005;
  Triangles mesh;
  for (const double side : {-1.0, 1.0}) {
    for (const double z : {0.0, kHeight_m}) {
      for (int i = 0; i < kColumns; ++i) {
        const double x = kWidth_m * (static_cast<double>(i) / (kColumns - 1) - 0.5);
        const double depth = 0.045 + 0.02 * std::sin(1.7 * x + 0.4);
        mesh.vertices_m.emplace_back(
            x, depth * std::sin(2.0 * std::numbers::pi * x / 0.2) + side * kHalfThickness_m, z);
      }
    }
  }
  const auto at = [&](int side, int level, int column) {
    return (2 * side + level) * kColumns + column;
  };
  const auto add_quad = [&](int a, int b, int c, int d) {
    mesh.faces.emplace_back(a, b, c);
    mesh.faces.emplace_back(a, c, d);
  };
  for (int i = 0; i + 1 < kColumns; ++i) {
    add_quad(at(0, 0, i), at(0, 0, i + 1), at(0, 1, i + 1), at(0, 1, i));
    add_quad(at(1, 0, i), at(1, 1, i), at(1, 1, i + 1), at(1, 0, i + 1));
    add_quad(at(0, 0, i), at(1, 0, i), at(1, 0, i + 1), at(0, 0, i + 1));
    add_quad(at(0, 1, i), at(0, 1, i + 1), at(1, 1, i + 1), at(1, 1, i));
  }
  add_quad(at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0));
  const int end = kColumns - 1;
  add_quad(at(0, 0, end), at(1, 0, end), at(1, 1, end), at(0, 1, end));
  return mesh;
}

}  // namespace sidestep::scene_meshes
