#include <sidestep/geometry/shape.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

using Triangle = std::array<Eigen::Vector3d, 3>;

constexpr int kLeafTriangles = 4;
/// A branch counts as one dipole from this many of its radii away.
constexpr double kDipoleRadii = 3.0;
/// Median splits halve the triangles, so no tree of 32-bit indices is deeper than this.
constexpr std::size_t kMaxDepth = 40;

Triangle corners(const Mesh& mesh, const Eigen::Vector3i& triangle) {
  return {mesh.vertices_m[idx(triangle[0])], mesh.vertices_m[idx(triangle[1])],
          mesh.vertices_m[idx(triangle[2])]};
}

double squared_distance_to_segment(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                   const Eigen::Vector3d& p) {
  const Eigen::Vector3d ab = b - a;
  const double length2 = ab.squaredNorm();
  const double t = length2 > 0.0 ? std::clamp((p - a).dot(ab) / length2, 0.0, 1.0) : 0.0;
  return (p - a - t * ab).squaredNorm();
}

double squared_distance(const Triangle& triangle, const Eigen::Vector3d& p) {
  const auto& [a, b, c] = triangle;
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double normal2 = normal.squaredNorm();
  const bool above_face = normal2 > 0.0 && normal.dot((b - a).cross(p - a)) >= 0.0 &&
                          normal.dot((c - b).cross(p - b)) >= 0.0 &&
                          normal.dot((a - c).cross(p - c)) >= 0.0;
  if (above_face) {
    const double height = normal.dot(p - a);
    return height * height / normal2;
  }
  return std::min({squared_distance_to_segment(a, b, p), squared_distance_to_segment(b, c, p),
                   squared_distance_to_segment(c, a, p)});
}

/// Solid angle of a triangle seen from p (van Oosterom and Strackee 1983), positive from
/// behind an outward-facing one.
double solid_angle(const Triangle& triangle, const Eigen::Vector3d& p) {
  const Eigen::Vector3d a = triangle[0] - p;
  const Eigen::Vector3d b = triangle[1] - p;
  const Eigen::Vector3d c = triangle[2] - p;
  const double la = a.norm();
  const double lb = b.norm();
  const double lc = c.norm();
  const double numerator = a.dot(b.cross(c));
  const double denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
  return 2.0 * std::atan2(numerator, denominator);
}

constexpr double kFullSphere = 4.0 * std::numbers::pi;

double with_sign(double squared_distance_m2, double winding) {
  const double distance_m = std::sqrt(squared_distance_m2);
  return std::abs(winding) > 0.5 ? -distance_m : distance_m;  // whichever way it is wound
}

/// Distance to the triangles signed by the generalised winding number, visiting all of them.
/// Infinity for a mesh without triangles.
double brute_force_signed_distance_m(const Mesh& mesh, const Eigen::Vector3d& p) {
  double nearest2 = kInfinity;
  double angle = 0.0;
  for (const Eigen::Vector3i& indices : mesh.triangles) {
    const Triangle triangle = corners(mesh, indices);
    nearest2 = std::min(nearest2, squared_distance(triangle, p));
    angle += solid_angle(triangle, p);
  }
  return with_sign(nearest2, angle / kFullSphere);
}

}  // namespace

/// A tree of bounding boxes over a mesh's triangles: distances by branch and bound, winding
/// numbers by adding up distant branches as dipoles (Barill et al. 2018, "Fast winding numbers
/// for soups and clouds"). The distance is exact; the winding number is approximate, which
/// decides only its sign.
class MeshIndex {
 public:
  explicit MeshIndex(const Mesh& mesh) {
    triangles_.reserve(mesh.triangles.size());
    for (const Eigen::Vector3i& triangle : mesh.triangles) {
      triangles_.push_back(corners(mesh, triangle));
    }
    if (!triangles_.empty()) build(0, static_cast<std::int32_t>(triangles_.size()));
  }

  [[nodiscard]] double signed_distance_m(const Eigen::Vector3d& p) const {
    double nearest2 = kInfinity;
    if (branches_.empty()) return nearest2;
    std::array<std::int32_t, kMaxDepth> stack{0};
    std::size_t depth = 1;
    while (depth > 0) {
      const std::int32_t at = stack[--depth];
      const Branch& branch = branches_[idx(at)];
      if (branch.bounds.squaredExteriorDistance(p) >= nearest2) continue;
      if (branch.right < 0) {
        for (auto i = branch.begin; i < branch.end; ++i) {
          nearest2 = std::min(nearest2, squared_distance(triangles_[idx(i)], p));
        }
        continue;
      }
      const auto bound2 = [&](std::int32_t child) {
        return branches_[idx(child)].bounds.squaredExteriorDistance(p);
      };
      const bool left_first = bound2(at + 1) <= bound2(branch.right);
      stack[depth++] = left_first ? branch.right : at + 1;
      stack[depth++] = left_first ? at + 1 : branch.right;
    }
    return with_sign(nearest2, winding_number(p));
  }

  [[nodiscard]] double winding_number(const Eigen::Vector3d& p) const {
    if (branches_.empty()) return 0.0;
    double angle = 0.0;
    std::array<std::int32_t, kMaxDepth> stack{0};
    std::size_t depth = 1;
    while (depth > 0) {
      const std::int32_t at = stack[--depth];
      const Branch& branch = branches_[idx(at)];
      const Eigen::Vector3d towards = branch.area_centre - p;
      const double distance_m = towards.norm();
      if (distance_m > kDipoleRadii * branch.radius_m) {
        angle += towards.dot(branch.area_normal) / (distance_m * distance_m * distance_m);
      } else if (branch.right < 0) {
        for (auto i = branch.begin; i < branch.end; ++i) {
          angle += solid_angle(triangles_[idx(i)], p);
        }
      } else {
        stack[depth++] = branch.right;
        stack[depth++] = at + 1;
      }
    }
    return angle / kFullSphere;
  }

 private:
  struct Branch {
    Eigen::AlignedBox3d bounds;
    Eigen::Vector3d area_centre = Eigen::Vector3d::Zero();  ///< Weighted by area.
    Eigen::Vector3d area_normal = Eigen::Vector3d::Zero();  ///< Sum of normals times areas.
    double radius_m = 0.0;                                  ///< Around area_centre.
    std::int32_t begin = 0;                                 ///< Triangles, in triangles_' order.
    std::int32_t end = 0;
    std::int32_t right = -1;  ///< The left child follows its parent; -1 for a leaf.
  };

  std::int32_t build(std::int32_t begin, std::int32_t end) {
    Branch branch;
    branch.begin = begin;
    branch.end = end;
    Eigen::AlignedBox3d centroids;
    double area = 0.0;
    for (auto i = begin; i < end; ++i) {
      const auto& [a, b, c] = triangles_[idx(i)];
      branch.bounds.extend(a).extend(b).extend(c);
      centroids.extend((a + b + c) / 3.0);
      const Eigen::Vector3d area_vector = 0.5 * (b - a).cross(c - a);
      branch.area_normal += area_vector;
      branch.area_centre += area_vector.norm() * (a + b + c) / 3.0;
      area += area_vector.norm();
    }
    branch.area_centre =
        area > 0.0 ? Eigen::Vector3d(branch.area_centre / area) : branch.bounds.center();
    for (auto i = begin; i < end; ++i) {
      for (const Eigen::Vector3d& corner : triangles_[idx(i)]) {
        branch.radius_m = std::max(branch.radius_m, (corner - branch.area_centre).norm());
      }
    }
    const auto index = static_cast<std::int32_t>(branches_.size());
    branches_.push_back(branch);
    if (end - begin <= kLeafTriangles) return index;

    Eigen::Index axis = 0;
    centroids.sizes().maxCoeff(&axis);
    const auto middle = begin + (end - begin) / 2;
    std::nth_element(triangles_.begin() + begin, triangles_.begin() + middle,
                     triangles_.begin() + end, [axis](const Triangle& s, const Triangle& t) {
                       return s[0][axis] + s[1][axis] + s[2][axis] <
                              t[0][axis] + t[1][axis] + t[2][axis];
                     });
    build(begin, middle);
    const std::int32_t right = build(middle, end);
    branches_[idx(index)].right = right;
    return index;
  }

  std::vector<Triangle> triangles_;
  std::vector<Branch> branches_;
};
namespace {

double distance_to(const Box& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d beyond = p.cwiseAbs() - 0.5 * box.size_m;
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

double distance_to(const Sphere& sphere, const Eigen::Vector3d& p) {
  return p.norm() - sphere.radius_m;
}

/// A cylinder is a rectangle in the half-plane of (distance to the axis, height).
double distance_to(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  const Eigen::Vector2d beyond(p.head<2>().norm() - cylinder.radius_m,
                               std::abs(p.z()) - 0.5 * cylinder.length_m);
  return beyond.cwiseMax(0.0).norm() + std::min(beyond.maxCoeff(), 0.0);
}

double distance_to(const Capsule& capsule, const Eigen::Vector3d& p) {
  const double half_m = 0.5 * capsule.length_m;
  const Eigen::Vector3d nearest_on_axis(0.0, 0.0, std::clamp(p.z(), -half_m, half_m));
  return (p - nearest_on_axis).norm() - capsule.radius_m;
}

double distance_to(const HalfSpace&, const Eigen::Vector3d& p) { return p.z(); }

double distance_to(const std::shared_ptr<const Mesh>& mesh, const Eigen::Vector3d& p) {
  return mesh->index ? mesh->index->signed_distance_m(p) : brute_force_signed_distance_m(*mesh, p);
}

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

std::string_view shape_name(const Shape& shape) noexcept {
  constexpr std::array<std::string_view, std::variant_size_v<Shape>> kNames = {
      "box", "sphere", "cylinder", "capsule", "half_space", "mesh"};
  return kNames[shape.index()];
}

double signed_distance_m(const Shape& shape, const Eigen::Vector3d& p_shape) {
  return std::visit([&](const auto& one) { return distance_to(one, p_shape); }, shape);
}

std::shared_ptr<const Mesh> indexed_mesh(Mesh mesh) {
  mesh.index = std::make_shared<const MeshIndex>(mesh);
  return std::make_shared<const Mesh>(std::move(mesh));
}

Mesh triangulate(const Shape& shape, int segments) {
  const int at_least_three = std::max(segments, 3);
  return std::visit([&](const auto& one) { return facets(one, at_least_three); }, shape);
}

}  // namespace sidestep
