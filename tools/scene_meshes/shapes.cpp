#include "shapes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <tuple>

#include <Eigen/Geometry>

namespace sidestep::scene_meshes {
namespace {

using Vector = Eigen::Vector3d;
using Implicit = std::function<double(const Vector&)>;  ///< Negative inside.

/// A ball that moves along a segment while its radius changes.
struct Limb {
  Vector from, to;
  double from_radius_m = 0.0, to_radius_m = 0.0;

  [[nodiscard]] double operator()(const Vector& p) const {
    const Vector along = to - from;
    const double length_squared = std::max(1e-12, along.squaredNorm());
    const double share = std::clamp((p - from).dot(along) / length_squared, 0.0, 1.0);
    return (p - from - share * along).norm() -
           (from_radius_m + share * (to_radius_m - from_radius_m));
  }
};

Limb ball(const Vector& centre, double radius_m) { return {centre, centre, radius_m, radius_m}; }

/// The lesser of two values, rounded off where they are nearer to each other than `blend_m`.
double smooth_min(double a, double b, double blend_m) {
  const double h = std::max(blend_m - std::abs(a - b), 0.0) / blend_m;
  return std::min(a, b) - 0.25 * h * h * blend_m;
}

Implicit body_of(std::vector<Limb> limbs, double blend_m) {
  return [limbs = std::move(limbs), blend_m](const Vector& p) {
    double value = limbs.front()(p);
    for (std::size_t i = 1; i < limbs.size(); ++i) value = smooth_min(value, limbs[i](p), blend_m);
    return value;
  };
}

/// The surface of an implicit shape as a net: one vertex in every cell that it passes through, in
/// the middle of where it crosses the cell's edges (Gibson 1998), one quadrilateral across every
/// edge that it crosses.
class SurfaceNet {
 public:
  SurfaceNet(Implicit shape, const Vector& low, const Vector& high, double cell_m)
      : shape_(std::move(shape)),
        low_(low),
        cell_m_(cell_m),
        counts_(((high - low) / cell_m).array().ceil().cast<int>().matrix() +
                Eigen::Vector3i::Ones()) {
    for (int z = 0; z < counts_.z(); ++z) {
      for (int y = 0; y < counts_.y(); ++y) {
        for (int x = 0; x < counts_.x(); ++x) values_.push_back(shape_(corner({x, y, z})));
      }
    }
  }

  [[nodiscard]] Triangles triangles() {
    for (int z = 1; z + 1 < counts_.z(); ++z) {
      for (int y = 1; y + 1 < counts_.y(); ++y) {
        for (int x = 1; x + 1 < counts_.x(); ++x) {
          for (int axis = 0; axis < 3; ++axis) cross_edge({x, y, z}, axis);
        }
      }
    }
    return std::move(mesh_);
  }

 private:
  [[nodiscard]] Vector corner(const Eigen::Vector3i& at) const {
    return low_ + cell_m_ * at.cast<double>();
  }
  [[nodiscard]] double value(const Eigen::Vector3i& at) const {
    return values_[static_cast<std::size_t>(at.x() +
                                            counts_.x() * (at.y() + counts_.y() * at.z()))];
  }

  /// The quadrilateral across the edge from corner `at` along `axis`, if the surface crosses it.
  void cross_edge(const Eigen::Vector3i& at, int axis) {
    const bool begins_inside = value(at) < 0.0;
    const bool ends_inside = value(at + Eigen::Vector3i::Unit(axis)) < 0.0;
    if (begins_inside == ends_inside) return;
    const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3);
    const Eigen::Vector3i v = Eigen::Vector3i::Unit((axis + 2) % 3);
    int a = vertex(at - u - v), b = vertex(at - v), c = vertex(at), d = vertex(at - u);
    if (ends_inside) std::swap(b, d);
    mesh_.faces.emplace_back(a, b, c);
    mesh_.faces.emplace_back(a, c, d);
  }

  /// The vertex of the cell whose lowest corner is `at`.
  int vertex(const Eigen::Vector3i& at) {
    const auto key = std::tuple(at.x(), at.y(), at.z());
    if (const auto known = vertices_.find(key); known != vertices_.end()) return known->second;
    Vector sum = Vector::Zero();
    int crossings = 0;
    for (int axis = 0; axis < 3; ++axis) {
      for (int i = 0; i < 4; ++i) {
        const Eigen::Vector3i from = at + (i & 1) * Eigen::Vector3i::Unit((axis + 1) % 3) +
                                     (i >> 1) * Eigen::Vector3i::Unit((axis + 2) % 3);
        const double begin = value(from), end = value(from + Eigen::Vector3i::Unit(axis));
        if ((begin < 0.0) == (end < 0.0)) continue;
        sum += corner(from) + cell_m_ * begin / (begin - end) * Vector::Unit(axis);
        ++crossings;
      }
    }
    const int index = static_cast<int>(mesh_.vertices_m.size());
    mesh_.vertices_m.emplace_back(sum / crossings);
    vertices_.emplace(key, index);
    return index;
  }

  Implicit shape_;
  Vector low_;
  double cell_m_;
  Eigen::Vector3i counts_;
  std::vector<double> values_;
  std::map<std::tuple<int, int, int>, int> vertices_;
  Triangles mesh_;
};

void add_both_sides(std::vector<Limb>& limbs, Limb limb) {
  limbs.push_back(limb);
  limb.from.y() *= -1.0;
  limb.to.y() *= -1.0;
  limbs.push_back(limb);
}

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

Triangles cow() {
  std::vector<Limb> limbs = {
      {{-0.52, 0, 0.95}, {0.42, 0, 0.98}, 0.35, 0.32},  // trunk
      ball({0.0, 0, 0.84}, 0.36),                       // belly
      ball({-0.35, 0, 0.60}, 0.14),                     // udder
      {{0.45, 0, 1.08}, {0.84, 0, 1.36}, 0.23, 0.14},   // neck
      {{0.84, 0, 1.40}, {1.14, 0, 1.22}, 0.14, 0.09},   // head
  };
  add_both_sides(limbs, {{0.84, 0.10, 1.46}, {0.80, 0.27, 1.48}, 0.05, 0.045});  // ears
  add_both_sides(limbs, {{0.38, 0.19, 0.75}, {0.40, 0.20, 0.05}, 0.12, 0.06});   // forelegs
  add_both_sides(limbs, {{-0.52, 0.19, 0.80}, {-0.60, 0.20, 0.45}, 0.17, 0.08});
  add_both_sides(limbs, {{-0.60, 0.20, 0.45}, {-0.54, 0.20, 0.05}, 0.08, 0.06});
  return SurfaceNet(body_of(std::move(limbs), 0.12), {-1.0, -0.5, -0.1}, {1.4, 0.5, 1.7}, 0.04)
      .triangles();
}

Triangles lady() {
  std::vector<Limb> limbs = {
      {{0, 0, 0.24}, {0, 0, 0.98}, 0.24, 0.12},             // dress
      {{0, 0, 1.00}, {0.01, 0, 1.32}, 0.12, 0.14},          // trunk
      {{0, -0.16, 1.38}, {0, 0.16, 1.38}, 0.065, 0.065},    // shoulders
      {{0, 0, 1.42}, {0.01, 0, 1.54}, 0.05, 0.05},          // neck
      ball({0.02, 0, 1.62}, 0.105),                         // head
      ball({-0.10, 0, 1.67}, 0.065),                        // hair
      {{0, 0.19, 1.36}, {-0.10, 0.34, 1.14}, 0.05, 0.045},  // an arm akimbo
      {{-0.10, 0.34, 1.14}, {0.04, 0.17, 1.02}, 0.045, 0.04},
      {{0, -0.19, 1.36}, {0.14, -0.24, 1.12}, 0.05, 0.045},  // and one held out
      {{0.14, -0.24, 1.12}, {0.38, -0.20, 1.22}, 0.045, 0.04},
  };
  return SurfaceNet(body_of(std::move(limbs), 0.06), {-0.5, -0.5, -0.1}, {0.6, 0.5, 1.9}, 0.03)
      .triangles();
}

Triangles armchair() {
  // A seat like a cushion, and a back that runs around it, lower towards the front.
  const auto seat = [](const Vector& p) {
    const Vector q = (p - Vector(0.02, 0, 0.22)).cwiseAbs() - Vector(0.22, 0.22, 0.08);
    return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0) - 0.12;
  };
  const auto back = [](const Vector& p) {
    const double shell = std::abs(std::hypot(p.x(), p.y()) - 0.40) - 0.03;
    const double top = p.z() - (0.62 - 0.42 * p.x());
    const double front = p.x() - 0.22;
    const double bottom = 0.10 - p.z();
    return std::max({shell, top, front, bottom}) - 0.05;
  };
  const Implicit shape = [seat, back](const Vector& p) {
    return smooth_min(seat(p), back(p), 0.08);
  };
  return SurfaceNet(shape, {-0.6, -0.6, -0.1}, {0.6, 0.6, 1.0}, 0.03).triangles();
}

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
