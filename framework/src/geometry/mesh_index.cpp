#include "mesh_index.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

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
  return winding > 0.5 ? -distance_m : distance_m;
}

}  // namespace

double brute_force_signed_distance_m(const Mesh& mesh, const Eigen::Vector3d& p) {
  double nearest2 = std::numeric_limits<double>::infinity();
  double angle = 0.0;
  for (const Eigen::Vector3i& indices : mesh.triangles) {
    const Triangle triangle = corners(mesh, indices);
    nearest2 = std::min(nearest2, squared_distance(triangle, p));
    angle += solid_angle(triangle, p);
  }
  return with_sign(nearest2, angle / kFullSphere);
}

MeshIndex::MeshIndex(const Mesh& mesh) {
  triangles_.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    triangles_.push_back(corners(mesh, triangle));
  }
  if (!triangles_.empty()) build(0, static_cast<std::int32_t>(triangles_.size()));
}

std::int32_t MeshIndex::build(std::int32_t begin, std::int32_t end) {
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

double MeshIndex::signed_distance_m(const Eigen::Vector3d& p) const {
  double nearest2 = std::numeric_limits<double>::infinity();
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

double MeshIndex::winding_number(const Eigen::Vector3d& p) const {
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

}  // namespace sidestep
