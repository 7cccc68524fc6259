#include <sidestep/robot/sphere_fit.hpp>

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

constexpr int kMaxSpheres = 64;
/// Covers what rounding would leave bare.
constexpr double kRadiusMargin = 1.0 + 1e-9;

struct Ball {
  Eigen::Vector3d p_shape;
  double radius_m;
};

/// A grid of equal spheres over a box; its cells are halved where they stand out the most.
std::vector<Ball> cover_box(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper,
                            double protrusion_m) {
  const Eigen::Vector3d half = 0.5 * (upper - lower);
  Eigen::Vector3i cells = Eigen::Vector3i::Ones();
  const auto cell_half = [&] { return half.cwiseQuotient(cells.cast<double>()).eval(); };
  while (cell_half().norm() - cell_half().minCoeff() > protrusion_m) {
    int longest = 0;
    cell_half().maxCoeff(&longest);
    Eigen::Vector3i finer = cells;
    finer[longest] += 1;
    if (finer.prod() > kMaxSpheres) break;
    cells = finer;
  }
  std::vector<Ball> balls;
  const Eigen::Vector3d step = 2.0 * cell_half();
  for (int i = 0; i < cells.x(); ++i) {
    for (int j = 0; j < cells.y(); ++j) {
      for (int k = 0; k < cells.z(); ++k) {
        const Eigen::Vector3d middle = Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5);
        balls.push_back({lower + middle.cwiseProduct(step), cell_half().norm() * kRadiusMargin});
      }
    }
  }
  return balls;
}

/// Spheres along the axis, or over the bounding box where the cylinder is too stout for that.
std::vector<Ball> cover_cylinder(const Cylinder& cylinder, double protrusion_m) {
  const double r = cylinder.radius_m;
  for (int n = 1; n <= kMaxSpheres; ++n) {
    const double slice_half = 0.5 * cylinder.length_m / n;
    const double radius = std::hypot(r, slice_half);
    if (radius - std::min(r, slice_half) > protrusion_m) continue;
    std::vector<Ball> balls;
    for (int i = 0; i < n; ++i) {
      const double z = -0.5 * cylinder.length_m + (2 * i + 1) * slice_half;
      balls.push_back({{0.0, 0.0, z}, radius * kRadiusMargin});
    }
    return balls;
  }
  const Eigen::Vector3d corner(r, r, 0.5 * cylinder.length_m);
  std::vector<Ball> balls = cover_box(-corner, corner, protrusion_m);
  std::erase_if(
      balls, [&](const Ball& ball) { return ball.p_shape.head<2>().norm() - ball.radius_m > r; });
  return balls;
}

std::vector<Ball> cover_capsule(const Capsule& capsule, double protrusion_m) {
  const double r = capsule.radius_m;
  // A sphere of radius R covers 2 sqrt(R^2 - r^2) of the axis; the outermost sit on the caps.
  const double radius = r + std::min(protrusion_m, 0.1 * r);
  const double pitch = 2.0 * std::sqrt(radius * radius - r * r);
  const int n = std::clamp(static_cast<int>(std::ceil(capsule.length_m / pitch)), 1, kMaxSpheres);
  const double step = capsule.length_m / n;
  std::vector<Ball> balls;
  for (int i = 0; i <= n; ++i) {
    balls.push_back({{0.0, 0.0, -0.5 * capsule.length_m + i * step},
                     std::hypot(r, 0.5 * step) * kRadiusMargin});
  }
  return balls;
}

std::vector<Ball> cover_mesh(const Mesh& mesh, double protrusion_m) {
  if (mesh.vertices_m.empty()) return {};
  Eigen::Vector3d lower = mesh.vertices_m.front();
  Eigen::Vector3d upper = lower;
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
    lower = lower.cwiseMin(vertex);
    upper = upper.cwiseMax(vertex);
  }
  return cover_box(lower, upper, protrusion_m);
}

struct Cover {
  double protrusion_m;
  std::vector<Ball> operator()(const Box& box) const {
    return cover_box(-0.5 * box.size_m, 0.5 * box.size_m, protrusion_m);
  }
  std::vector<Ball> operator()(const Sphere& sphere) const {
    return {{Eigen::Vector3d::Zero(), sphere.radius_m}};
  }
  std::vector<Ball> operator()(const Cylinder& cylinder) const {
    return cover_cylinder(cylinder, protrusion_m);
  }
  std::vector<Ball> operator()(const Capsule& capsule) const {
    return cover_capsule(capsule, protrusion_m);
  }
  std::vector<Ball> operator()(const HalfSpace&) const { return {}; }
  std::vector<Ball> operator()(const std::shared_ptr<const Mesh>& mesh) const {
    return mesh == nullptr ? std::vector<Ball>{} : cover_mesh(*mesh, protrusion_m);
  }
};

}  // namespace

std::vector<CollisionSphere> fit_spheres(const CollisionShape& shape, double protrusion_m) {
  std::vector<CollisionSphere> spheres;
  for (const Ball& ball : std::visit(Cover{protrusion_m}, shape.shape)) {
    if (!(ball.radius_m > 0.0)) continue;
    spheres.push_back({shape.link, shape.T_link_shape * ball.p_shape, ball.radius_m});
  }
  return spheres;
}

}  // namespace sidestep
