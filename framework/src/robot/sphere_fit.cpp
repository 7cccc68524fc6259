#include <sidestep/robot/sphere_fit.hpp>

#include <algorithm>
#include <cmath>
#include <optional>

#include <sidestep/core/format.hpp>

#include "solid_cover.hpp"

namespace sidestep {
namespace {

constexpr int kMostSpheres = kMostFittedSpheres;
/// So few in a plain order are taken as they are; a cover that looks for its places may do with
/// fewer than more of them.
constexpr std::size_t kFewSpheres = 64;

using Balls = std::optional<std::vector<Ball>>;

/// A grid of equal spheres; its cells are halved where they stand out the most.
Balls cover_box(const Box& box, double protrusion_m) {
  const Eigen::Vector3d half = 0.5 * box.size_m;
  Eigen::Vector3i cells = Eigen::Vector3i::Ones();
  const auto cell_half = [&] { return half.cwiseQuotient(cells.cast<double>()).eval(); };
  while (cell_half().norm() - cell_half().minCoeff() > protrusion_m) {
    int longest = 0;
    cell_half().maxCoeff(&longest);
    cells[longest] += 1;
    if (cells.cast<double>().prod() > kMostSpheres) return {};
  }
  std::vector<Ball> balls;
  const Eigen::Vector3d step = 2.0 * cell_half();
  for (int i = 0; i < cells.x(); ++i) {
    for (int j = 0; j < cells.y(); ++j) {
      for (int k = 0; k < cells.z(); ++k) {
        const Eigen::Vector3d middle = Eigen::Vector3d(i, j, k) + Eigen::Vector3d::Constant(0.5);
        balls.push_back({middle.cwiseProduct(step) - half, cell_half().norm() * kRadiusMargin});
      }
    }
  }
  return balls;
}

/// Spheres along the axis; nothing where the cylinder is too stout for that.
Balls cover_cylinder(const Cylinder& cylinder, double protrusion_m) {
  const double r = cylinder.radius_m;
  for (int n = 1; n <= kMostSpheres; ++n) {
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
  return {};
}

Balls cover_capsule(const Capsule& capsule, double protrusion_m) {
  const double r = capsule.radius_m;
  // A sphere of radius R covers 2 sqrt(R^2 - r^2) of the axis; the outermost sit on the caps.
  const double radius = r + std::min(protrusion_m, 0.1 * r);
  const double pitch = 2.0 * std::sqrt(radius * radius - r * r);
  if (!(capsule.length_m <= pitch * (kMostSpheres - 1))) return {};
  const int n = std::max(1, static_cast<int>(std::ceil(capsule.length_m / pitch)));
  const double step = capsule.length_m / n;
  std::vector<Ball> balls;
  for (int i = 0; i <= n; ++i) {
    balls.push_back({{0.0, 0.0, -0.5 * capsule.length_m + i * step},
                     std::hypot(r, 0.5 * step) * kRadiusMargin});
  }
  return balls;
}

/// Spheres in the order that the shape's form suggests.
struct PlainCover {
  double protrusion_m;
  Balls operator()(const Box& box) const { return cover_box(box, protrusion_m); }
  Balls operator()(const Sphere& sphere) const {
    return std::vector<Ball>{{Eigen::Vector3d::Zero(), sphere.radius_m}};
  }
  Balls operator()(const Cylinder& cylinder) const {
    return cover_cylinder(cylinder, protrusion_m);
  }
  Balls operator()(const Capsule& capsule) const { return cover_capsule(capsule, protrusion_m); }
  Balls operator()(const HalfSpace&) const { return std::vector<Ball>(); }
  Balls operator()(const std::shared_ptr<const Mesh>&) const { return {}; }
};

}  // namespace

Result<std::vector<CollisionSphere>> fit_spheres(const CollisionShape& shape, double protrusion_m) {
  if (!(protrusion_m > 0.0) || !std::isfinite(protrusion_m)) {
    return invalid("spheres stand out by a length above zero");
  }
  Balls balls = std::visit(PlainCover{protrusion_m}, shape.shape);
  if (!balls || balls->size() > kFewSpheres) {
    const std::size_t most = balls ? balls->size() - 1 : std::size_t{kMostSpheres};
    if (auto fewer = cover_solid(shape.shape, protrusion_m, most)) balls = std::move(fewer);
  }
  if (!balls) {
    return fail(ErrorCode::kInvalidArgument,
                format("more than %d spheres are needed to cover a ", kMostSpheres) +
                    std::string(shape_name(shape.shape)) +
                    format(" so that none stands out by more than %g m", protrusion_m),
                {}, "let them stand out farther, or list the spheres");
  }
  std::vector<CollisionSphere> spheres;
  for (const Ball& ball : *balls) {
    if (!(ball.radius_m > 0.0)) continue;
    spheres.push_back({shape.link, shape.T_link_shape * ball.p_shape, ball.radius_m});
  }
  return spheres;
}

}  // namespace sidestep
