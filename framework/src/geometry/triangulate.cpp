#include <cmath>
#include <numbers>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {
namespace {

/// A surface of revolution about z from a profile of rings, closed by a pole at either end.
class Lathe {
 public:
  explicit Lathe(int segments) : segments_(segments) {}

  void ring(double radius_m, double z_m) {
    for (int i = 0; i < segments_; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / segments_;
      mesh_.vertices_m.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    }
    ++rings_;
  }

  /// Rings must have been added from the bottom up.
  Mesh close(double bottom_z_m, double top_z_m) {
    const int bottom = static_cast<int>(mesh_.vertices_m.size());
    const int top = bottom + 1;
    mesh_.vertices_m.emplace_back(0.0, 0.0, bottom_z_m);
    mesh_.vertices_m.emplace_back(0.0, 0.0, top_z_m);
    for (int i = 0; i < segments_; ++i) {
      const int next = (i + 1) % segments_;
      mesh_.triangles.emplace_back(bottom, next, i);
      for (int r = 0; r + 1 < rings_; ++r) {
        const int low = r * segments_;
        const int high = low + segments_;
        mesh_.triangles.emplace_back(low + i, low + next, high + next);
        mesh_.triangles.emplace_back(low + i, high + next, high + i);
      }
      const int last = (rings_ - 1) * segments_;
      mesh_.triangles.emplace_back(last + i, last + next, top);
    }
    return std::move(mesh_);
  }

 private:
  int segments_;
  int rings_ = 0;
  Mesh mesh_;
};

Mesh facets(const Box& box, int) {
  Mesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign((corner & 1) != 0 ? 0.5 : -0.5, (corner & 2) != 0 ? 0.5 : -0.5,
                               (corner & 4) != 0 ? 0.5 : -0.5);
    mesh.vertices_m.push_back(sign.cwiseProduct(box.size_m));
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

Mesh facets(const Capsule& capsule, int segments) {
  Lathe lathe(segments);
  const int rings = std::max(segments / 4, 1);  // of each cap, from its pole to its rim
  const double half_m = 0.5 * capsule.length_m;
  const auto cap_ring = [&](int step, double centre_z_m) {
    const double latitude = 0.5 * std::numbers::pi * step / rings;
    lathe.ring(capsule.radius_m * std::cos(latitude),
               centre_z_m + capsule.radius_m * std::sin(latitude));
  };
  for (int step = -(rings - 1); step <= 0; ++step) cap_ring(step, -half_m);
  for (int step = half_m > 0.0 ? 0 : 1; step < rings; ++step) cap_ring(step, half_m);
  return lathe.close(-half_m - capsule.radius_m, half_m + capsule.radius_m);
}

Mesh facets(const Sphere& sphere, int segments) {
  return facets(Capsule{sphere.radius_m, 0.0}, segments);
}

Mesh facets(const Cylinder& cylinder, int segments) {
  Lathe lathe(segments);
  const double half_m = 0.5 * cylinder.length_m;
  lathe.ring(cylinder.radius_m, -half_m);
  lathe.ring(cylinder.radius_m, half_m);
  return lathe.close(-half_m, half_m);
}

Mesh facets(const HalfSpace&, int) { return {}; }

Mesh facets(const std::shared_ptr<const Mesh>& mesh, int) { return *mesh; }

}  // namespace

Mesh triangulate(const Shape& shape, int segments) {
  const int at_least_three = std::max(segments, 3);
  return std::visit([&](const auto& one) { return facets(one, at_least_three); }, shape);
}

}  // namespace sidestep
