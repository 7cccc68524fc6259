#include "standing_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace sidestep {
namespace {

constexpr double kBoundRounding_m = 1e-6;
constexpr double kFacetDepth_m = 0.5 * kFacetError_m;

class Survey {
 public:
  Survey(const DistanceTo& distance_m, double limit_m)
      : distance_m_(distance_m), limit_m_(limit_m) {}

  StandingOut run(const Mesh& surface) {
    const auto corner = [&](int index) {
      return surface.vertices_m[static_cast<std::size_t>(index)];
    };
    for (const Eigen::Vector3i& t : surface.triangles) {
      for (const int index : t) look_at(corner(index));
    }
    for (const Eigen::Vector3i& t : surface.triangles) {
      add({corner(t[0]), corner(t[1]), corner(t[2])});
    }
    return out_;
  }

 private:
  using Triangle = std::array<Eigen::Vector3d, 3>;

  double look_at(const Eigen::Vector3d& p) {
    double distance = distance_m_(p);
    if (std::isnan(distance)) distance = std::numeric_limits<double>::infinity();
    if (distance > kBoundRounding_m && distance > out_.farthest_m) {
      out_.farthest_m = distance;
      out_.p_farthest = p;
    }
    return distance;
  }

  /// Branch and bound: divided is what may be inside and outside, or farther out than all so far.
  void add(const Triangle& t) {
    const Eigen::Vector3d centre = (t[0] + t[1] + t[2]) / 3.0;
    const double distance = look_at(centre);
    double reach = 0.0;
    for (const Eigen::Vector3d& corner : t) reach = std::max(reach, (corner - centre).norm());
    const bool is_inside = distance + reach <= kBoundRounding_m;
    const bool is_outside =
        distance - reach > kBoundRounding_m && distance + reach <= out_.farthest_m;
    const bool is_open = out_.farthest_m <= limit_m_ && distance + reach > limit_m_;
    const double fine =
        is_open ? kProofFineness_m : std::max(kSurfaceFineness_m, kSurfaceShare * distance);
    if (!is_inside && !is_outside && reach > fine) return divide(t);
    out_.at_most_m = std::max(out_.at_most_m, distance + reach);
    const double area_m2 = 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).norm();
    out_.surface_m2 += area_m2;
    if (distance > kBoundRounding_m) out_.outside_m2 += area_m2;
  }

  /// At the middle of the longest edge.
  void divide(const Triangle& t) {
    std::size_t longest = 0;
    double length = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double own = (t[(i + 1) % 3] - t[i]).norm();
      if (own > length) longest = i, length = own;
    }
    const Eigen::Vector3d& a = t[longest];
    const Eigen::Vector3d& b = t[(longest + 1) % 3];
    const Eigen::Vector3d& c = t[(longest + 2) % 3];
    const Eigen::Vector3d middle = 0.5 * (a + b);
    add({a, middle, c});
    add({middle, b, c});
  }

  const DistanceTo& distance_m_;
  double limit_m_;
  StandingOut out_;
};

/// So many facets a turn that their middles lie kFacetDepth_m within the circle, of a ball twice.
int segments_of(double radius_m) {
  if (!(radius_m > kFacetDepth_m)) return 12;
  const double turn = std::numbers::pi / std::acos(1.0 - kFacetDepth_m / radius_m);
  return std::clamp(4 * static_cast<int>(std::ceil(turn / 4.0)), 12, 4096);
}

struct Roundness {
  double operator()(const Sphere& sphere) const { return sphere.radius_m; }
  double operator()(const Cylinder& cylinder) const { return cylinder.radius_m; }
  double operator()(const Capsule& capsule) const { return capsule.radius_m; }
  template <class Flat>
  double operator()(const Flat&) const {
    return 0.0;
  }
};

}  // namespace

StandingOut standing_out(const Mesh& surface, const DistanceTo& distance_m, double limit_m) {
  return Survey(distance_m, limit_m).run(surface);
}

Mesh surface_of(const Shape& shape) {
  return triangulate(shape, segments_of(std::visit(Roundness{}, shape)));
}

double facet_error_m(const Shape& shape) {
  return std::visit(Roundness{}, shape) > 0.0 ? kFacetError_m : 0.0;
}

double signed_distance_m(const std::vector<BodySphere>& spheres, const Eigen::Vector3d& p_body) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const BodySphere& sphere : spheres) {
    nearest = std::min(nearest, (p_body - sphere.p_body).norm() - sphere.radius_m);
  }
  return nearest;
}

}  // namespace sidestep
