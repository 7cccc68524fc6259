#include "sphere_cover.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "surface_samples.hpp"

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
  /// From a point to the nearest sphere; negative within.
  [[nodiscard]] double gap_m(const Eigen::Vector3d& p_body) const {
    double nearest = std::numeric_limits<double>::infinity();
    for (const BodySphere& sphere : spheres_) {
      nearest = std::min(nearest, (p_body - sphere.p_body).norm() - sphere.radius_m);
    }
    return nearest;
  }

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
      const double gap = std::min(gap_m(p_body), reach_m(part));
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
      const bool is_covered = gap_m(p_body) <= 0.0;
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

}  // namespace sidestep
