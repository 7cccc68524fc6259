#include "shape_covers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "cluster_fit.hpp"
#include "surface_samples.hpp"

namespace sidestep {
namespace {

constexpr std::size_t kCoverSamples = 512;
/// Covers what rounding would leave bare.
constexpr double kRadiusMargin = 1.0 + 1e-9;
constexpr int kLargestRing = 8;

/// In the shape's frame.
struct Ball {
  Eigen::Vector3d p_shape;
  double radius_m;
};
using Balls = std::vector<Ball>;

/// A ring of n >= 3 discs that cover a disc of radius 1: each holds a sector.
struct Ring {
  double centre;  ///< Of each disc, from the middle.
  double radius;  ///< Of each disc.
};
Ring ring_of(int n) {
  const double half_angle = std::numbers::pi / n;
  if (n == 3) return {std::cos(half_angle), std::sin(half_angle)};
  return {0.5 / std::cos(half_angle), 0.5 / std::cos(half_angle)};  // through the middle
}

/// `slices` along the axis, of one sphere or a ring of some.
Balls stack(const Cylinder& cylinder, int slices, int around) {
  const double slice_half = 0.5 * cylinder.length_m / slices;
  const Ring ring = around == 1 ? Ring{0.0, 1.0} : ring_of(around);
  const double out = ring.centre * cylinder.radius_m;
  const double radius = std::hypot(ring.radius * cylinder.radius_m, slice_half) * kRadiusMargin;
  Balls balls;
  for (int i = 0; i < slices; ++i) {
    const double z = -0.5 * cylinder.length_m + (2 * i + 1) * slice_half;
    for (int j = 0; j < around; ++j) {
      const double angle = 2.0 * std::numbers::pi * j / around;
      balls.push_back({{out * std::cos(angle), out * std::sin(angle), z}, radius});
    }
  }
  return balls;
}

Balls grid(const Box& box, const Eigen::Vector3i& cells) {
  const Eigen::Vector3d half = 0.5 * box.size_m.cwiseQuotient(cells.cast<double>());
  Balls balls;
  for (int i = 0; i < cells.x(); ++i) {
    for (int j = 0; j < cells.y(); ++j) {
      for (int k = 0; k < cells.z(); ++k) {
        const Eigen::Vector3d at(2 * i + 1 - cells.x(), 2 * j + 1 - cells.y(),
                                 2 * k + 1 - cells.z());
        balls.push_back({at.cwiseProduct(half), half.norm() * kRadiusMargin});
      }
    }
  }
  return balls;
}

/// Spheres at both ends and n - 1 between them.
Balls row(const Capsule& capsule, int n) {
  const double step = capsule.length_m / n;
  Balls balls;
  for (int i = 0; i <= n; ++i) {
    balls.push_back({{0.0, 0.0, -0.5 * capsule.length_m + i * step},
                     std::hypot(capsule.radius_m, 0.5 * step) * kRadiusMargin});
  }
  return balls;
}

/// All arrangements of at most `most` spheres.
struct Arrangements {
  int most;

  std::vector<Balls> operator()(const Box& box) const {
    std::vector<Balls> all;
    for (Eigen::Vector3i cells = Eigen::Vector3i::Ones(); cells.prod() <= most;) {
      all.push_back(grid(box, cells));
      int longest = 0;
      box.size_m.cwiseQuotient(cells.cast<double>()).maxCoeff(&longest);
      ++cells[longest];
    }
    return all;
  }
  std::vector<Balls> operator()(const Sphere& sphere) const {
    return {{{Eigen::Vector3d::Zero(), sphere.radius_m}}};
  }
  std::vector<Balls> operator()(const Cylinder& cylinder) const {
    std::vector<Balls> all;
    for (int around = 1; around <= kLargestRing; around += around == 1 ? 2 : 1) {
      for (int slices = 1; around * slices <= most; ++slices) {
        all.push_back(stack(cylinder, slices, around));
      }
    }
    return all;
  }
  std::vector<Balls> operator()(const Capsule& capsule) const {
    std::vector<Balls> all{{{Eigen::Vector3d::Zero(), capsule.radius_m + 0.5 * capsule.length_m}}};
    for (int n = 1; n < most; ++n) all.push_back(row(capsule, n));
    return all;
  }
  std::vector<Balls> operator()(const HalfSpace&) const { return {}; }
  std::vector<Balls> operator()(const std::shared_ptr<const Mesh>&) const { return {}; }
};

/// In the frame of the body.
std::vector<std::vector<BodySphere>> arrangements(const BodyPart& part, int most) {
  std::vector<std::vector<BodySphere>> all;
  for (const Balls& balls : std::visit(Arrangements{most}, part.shape)) {
    std::vector<BodySphere>& spheres = all.emplace_back();
    for (const Ball& ball : balls) {
      spheres.push_back({part.link, part.T_body_shape * ball.p_shape, ball.radius_m});
    }
  }
  return all;
}

/// A mesh has no axis to go by: ever finer clusters.
std::vector<std::vector<BodySphere>> mesh_clusters(const RigidBody& body, const BodyPart& part,
                                                   int most, const std::stop_token& stop) {
  RigidBody alone{body.links, {part}};
  const double size = bounds_of(part.shape).half_m.norm();
  std::vector<std::vector<BodySphere>> all;
  for (double protrusion = size; protrusion > 0.01 * size; protrusion *= 0.7) {
    ClusterFit fit(alone, part.link, {}, {protrusion, 0.2 * protrusion});
    fit.reach_protrusion(most, stop);
    all.push_back(spheres_of(alone, fit.result()));
    if (static_cast<int>(all.back().size()) >= most || stop.stop_requested()) break;
  }
  return all;
}

ShapeCover measured(const RigidBody& body, std::vector<BodySphere> spheres,
                    const std::vector<Eigen::Vector3d>& within) {
  ShapeCover cover;
  for (const BodySphere& sphere : spheres) {
    const double r = sphere.radius_m;
    cover.protrusion_m = std::max(cover.protrusion_m, r + signed_distance_m(body, sphere.p_body));
    double outside = 0.0;
    for (const Eigen::Vector3d& unit : within) {
      const Eigen::Vector3d p_body = sphere.p_body + r * unit;
      if (signed_distance_m(body, p_body) <= 0.0) continue;
      const auto holding = std::ranges::count_if(spheres, [&](const BodySphere& other) {
        return (p_body - other.p_body).squaredNorm() <= other.radius_m * other.radius_m;
      });
      outside += 1.0 / static_cast<double>(std::max<std::ptrdiff_t>(1, holding));
    }
    cover.excess_m3 += 4.0 / 3.0 * std::numbers::pi * r * r * r * outside / kCoverSamples;
  }
  cover.spheres = std::move(spheres);
  return cover;
}

}  // namespace

std::vector<ShapeCover> shape_covers(const RigidBody& body, const BodyPart& part, int most_spheres,
                                     const std::stop_token& stop) {
  const bool is_mesh = std::holds_alternative<std::shared_ptr<const Mesh>>(part.shape);
  auto all =
      is_mesh ? mesh_clusters(body, part, most_spheres, stop) : arrangements(part, most_spheres);
  const std::vector<Eigen::Vector3d> within = even_in_ball(kCoverSamples);
  std::vector<ShapeCover> covers;
  for (auto& spheres : all) covers.push_back(measured(body, std::move(spheres), within));
  std::ranges::stable_sort(covers, [](const ShapeCover& a, const ShapeCover& b) {
    return std::pair(a.spheres.size(), a.excess_m3) < std::pair(b.spheres.size(), b.excess_m3);
  });
  double least = std::numeric_limits<double>::infinity();
  std::erase_if(covers, [&](const ShapeCover& cover) {
    const bool is_worse = cover.excess_m3 >= least;
    least = std::min(least, cover.excess_m3);
    return is_worse;
  });
  return covers;
}

}  // namespace sidestep
