#include "sphere_cover.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

namespace sidestep {
namespace {

constexpr double kRounding_m = 1e-9;
constexpr std::size_t kSurfaceSamples = 4096;  // a shape
constexpr std::size_t kVolumeSamples = 8192;   // a shape
constexpr std::size_t kBallSamples = 4096;     // a sphere
constexpr std::size_t kDirections = 512;       // of a sphere

/// What is summed up on the way to a Cover.
struct Sums {
  double surface_m2 = 0.0, covered_m2 = 0.0;
  double volume_m3 = 0.0, covered_m3 = 0.0;
  double spheres_m3 = 0.0, excess_m3 = 0.0;
  double gap_m = 0.0, protrusion_m = 0.0;
  int spheres = 0;

  [[nodiscard]] Cover cover() const {
    const auto share = [](double part, double all) { return all > 0.0 ? part / all : 1.0; };
    return {.spheres = spheres,
            .surface_share = share(covered_m2, surface_m2),
            .volume_share = share(covered_m3, volume_m3),
            .gap_m = gap_m,
            .protrusion_m = protrusion_m,
            .shapes_m3 = volume_m3,
            .spheres_m3 = spheres_m3,
            .excess_m3 = excess_m3};
  }
};

/// The samples that are the same for every sphere.
struct SphereSamples {
  std::vector<Eigen::Vector3d> within = even_in_ball(kBallSamples);
  std::vector<Eigen::Vector3d> around = even_on_sphere(kDirections);
};

/// Measures one body; adds to the sums of its links and of the whole robot.
class BodyMeasure {
 public:
  BodyMeasure(const RigidBody& body, const std::vector<CollisionSphere>& spheres,
              std::map<int, Sums>& links, Sums& whole)
      : body_(body), spheres_(spheres_of(body, spheres)), links_(links), whole_(whole) {}

  void run(const SphereSamples& samples) {
    for (const BodyPart& part : body_.parts) {
      add_surface(part);
      add_volume(part);
    }
    for (const BodySphere& sphere : spheres_) {
      ++links_[sphere.link].spheres;
      ++whole_.spheres;
      add_ball(sphere, samples.within);
      add_protrusion(sphere, samples.around);
    }
  }

 private:
  /// Without spheres, as far as the shape reaches.
  [[nodiscard]] static double reach_m(const BodyPart& part) {
    return 2.0 * bounds_of(part.shape).half_m.norm();
  }

  [[nodiscard]] bool is_within(const BodyPart& part, const Eigen::Vector3d& p_body,
                               double depth_m) const {
    return signed_distance_m(part.shape, part.T_shape_body * p_body) < -depth_m;
  }

  void add_surface(const BodyPart& part) {
    Sums& link = links_[part.link];
    for (const SurfaceSample& sample : surface_samples(part.shape, kSurfaceSamples)) {
      const Eigen::Vector3d p_body = part.T_body_shape * sample.p_shape;
      const bool is_inside = std::ranges::any_of(body_.parts, [&](const BodyPart& other) {
        return &other != &part && is_within(other, p_body, kRounding_m);
      });
      if (is_inside) continue;
      const double gap = std::min(signed_distance_m(spheres_, p_body), reach_m(part));
      for (Sums* const sums : {&link, &whole_}) {
        sums->surface_m2 += sample.area_m2;
        if (gap <= kRounding_m) sums->covered_m2 += sample.area_m2;
        if (gap > kRounding_m) sums->gap_m = std::max(sums->gap_m, gap);
      }
    }
  }

  /// Where shapes overlap, each of them stands for its part.
  void add_volume(const BodyPart& part) {
    const ShapeBounds bounds = bounds_of(part.shape);
    const double each_m3 = 8.0 * bounds.half_m.prod() / kVolumeSamples;
    Sums& link = links_[part.link];
    for (std::size_t i = 0; i < kVolumeSamples; ++i) {
      const Eigen::Vector3d unit = 2.0 * even_in_cube(i) - Eigen::Vector3d::Ones();
      const Eigen::Vector3d p_shape = bounds.centre_m + unit.cwiseProduct(bounds.half_m);
      if (signed_distance_m(part.shape, p_shape) > 0.0) continue;
      const Eigen::Vector3d p_body = part.T_body_shape * p_shape;
      int in_link = 1, in_body = 1;
      for (const BodyPart& other : body_.parts) {
        if (&other == &part || !is_within(other, p_body, 0.0)) continue;
        ++in_body;
        if (other.link == part.link) ++in_link;
      }
      const bool is_covered = signed_distance_m(spheres_, p_body) <= 0.0;
      link.volume_m3 += each_m3 / in_link;
      whole_.volume_m3 += each_m3 / in_body;
      if (!is_covered) continue;
      link.covered_m3 += each_m3 / in_link;
      whole_.covered_m3 += each_m3 / in_body;
    }
  }

  void add_ball(const BodySphere& sphere, const std::vector<Eigen::Vector3d>& within) {
    const double r = sphere.radius_m;
    const double each_m3 = 4.0 / 3.0 * std::numbers::pi * r * r * r / kBallSamples;
    Sums& link = links_[sphere.link];
    for (const Eigen::Vector3d& unit : within) {
      const Eigen::Vector3d p_body = sphere.p_body + r * unit;
      int in_link = 1, in_body = 1;
      for (const BodySphere& other : spheres_) {
        if (&other == &sphere) continue;
        if ((p_body - other.p_body).squaredNorm() > other.radius_m * other.radius_m) continue;
        ++in_body;
        if (other.link == sphere.link) ++in_link;
      }
      const bool is_outside = signed_distance_m(body_, p_body) > 0.0;
      link.spheres_m3 += each_m3 / in_link;
      whole_.spheres_m3 += each_m3 / in_body;
      if (!is_outside) continue;
      link.excess_m3 += each_m3 / in_link;
      whole_.excess_m3 += each_m3 / in_body;
    }
  }

  void add_protrusion(const BodySphere& sphere, const std::vector<Eigen::Vector3d>& around) {
    if (body_.parts.empty()) return;
    double farthest = signed_distance_m(body_, sphere.p_body + sphere.radius_m * uphill(sphere));
    for (const Eigen::Vector3d& direction : around) {
      farthest =
          std::max(farthest, signed_distance_m(body_, sphere.p_body + sphere.radius_m * direction));
    }
    for (Sums* const sums : {&links_[sphere.link], &whole_}) {
      sums->protrusion_m = std::max(sums->protrusion_m, farthest);
    }
  }

  /// Where the shapes end soonest, seen from the sphere's centre: it stands out there the most.
  [[nodiscard]] Eigen::Vector3d uphill(const BodySphere& sphere) const {
    const double step = 1e-4 * sphere.radius_m;
    Eigen::Vector3d gradient;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d aside = step * Eigen::Vector3d::Unit(axis);
      gradient[axis] = signed_distance_m(body_, sphere.p_body + aside) -
                       signed_distance_m(body_, sphere.p_body - aside);
    }
    return gradient.norm() > 0.0 ? gradient.normalized().eval() : Eigen::Vector3d::UnitZ().eval();
  }

  const RigidBody& body_;
  std::vector<BodySphere> spheres_;
  std::map<int, Sums>& links_;
  Sums& whole_;
};

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

RobotCover measure_cover(const std::vector<RigidBody>& bodies,
                         const std::vector<CollisionSphere>& spheres) {
  const SphereSamples samples;
  std::map<int, Sums> links;
  Sums whole;
  for (const RigidBody& body : bodies) BodyMeasure(body, spheres, links, whole).run(samples);
  RobotCover cover;
  for (const auto& [link, sums] : links) cover.links.push_back({link, sums.cover()});
  cover.whole = whole.cover();
  return cover;
}

StandingOut standing_out(const Mesh& surface, const DistanceTo& distance_m, double limit_m) {
  return Survey(distance_m, limit_m).run(surface);
}

Mesh surface_of(const Shape& shape) {
  return triangulate(shape, segments_of(std::visit(Roundness{}, shape)));
}

double facet_error_m(const Shape& shape) {
  return std::visit(Roundness{}, shape) > 0.0 ? kFacetError_m : 0.0;
}

}  // namespace sidestep
