#include "rigid_body.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

bool has_volume(const Shape& shape) { return (bounds_of(shape).half_m.array() > 0.0).all(); }

struct Bounds {
  ShapeBounds operator()(const Box& box) const {
    return {Eigen::Vector3d::Zero(), 0.5 * box.size_m};
  }
  ShapeBounds operator()(const Sphere& sphere) const {
    return {Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(sphere.radius_m)};
  }
  ShapeBounds operator()(const Cylinder& cylinder) const {
    const double r = cylinder.radius_m;
    return {Eigen::Vector3d::Zero(), {r, r, 0.5 * cylinder.length_m}};
  }
  ShapeBounds operator()(const Capsule& capsule) const {
    const double r = capsule.radius_m;
    return {Eigen::Vector3d::Zero(), {r, r, 0.5 * capsule.length_m + r}};
  }
  ShapeBounds operator()(const HalfSpace&) const { return {}; }
  ShapeBounds operator()(const std::shared_ptr<const Mesh>& mesh) const {
    if (mesh == nullptr || mesh->triangles.empty()) return {};
    Eigen::Vector3d lower = mesh->vertices_m.front();
    Eigen::Vector3d upper = lower;
    for (const Eigen::Vector3d& vertex : mesh->vertices_m) {
      lower = lower.cwiseMin(vertex);
      upper = upper.cwiseMax(vertex);
    }
    return {0.5 * (lower + upper), 0.5 * (upper - lower)};
  }
};

using std::numbers::pi;

constexpr int kRimPoints = 64;

double fraction(double value) noexcept { return value - std::floor(value); }

/// The i-th of a sequence that fills the unit square evenly.
Eigen::Vector2d even_in_square(std::size_t i) noexcept {
  constexpr double kRatio = 1.32471795724474602596;
  const double n = static_cast<double>(i) + 1.0;
  return {fraction(0.5 + n / kRatio), fraction(0.5 + n / (kRatio * kRatio))};
}

/// Collects the samples of one shape, face by face.
class Sampler {
 public:
  Sampler(double area_m2, std::size_t count)
      : per_m2_(area_m2 > 0.0 ? static_cast<double>(count) / area_m2 : 0.0) {}

  /// A face that `place` maps the unit square to, area for area.
  template <class Place>
  void face(double area_m2, const Place& place) {
    const auto count = std::max<std::size_t>(1, std::lround(per_m2_ * area_m2));
    const double each_m2 = area_m2 / static_cast<double>(count);
    for (std::size_t i = 0; i < count; ++i) {
      samples_.push_back({place(even_in_square(next_++)), each_m2});
    }
  }
  void point(const Eigen::Vector3d& p_shape) { samples_.push_back({p_shape, 0.0}); }

  [[nodiscard]] std::vector<SurfaceSample> take() { return std::move(samples_); }

 private:
  double per_m2_;
  std::size_t next_ = 0;
  std::vector<SurfaceSample> samples_;
};

Eigen::Vector3d on_circle(double radius, double turn, double z) {
  return {radius * std::cos(2.0 * pi * turn), radius * std::sin(2.0 * pi * turn), z};
}

struct Sample {
  std::size_t count;

  std::vector<SurfaceSample> operator()(const Box& box) const {
    const Eigen::Vector3d size = box.size_m;
    const Eigen::Vector3d areas(size.y() * size.z(), size.x() * size.z(), size.x() * size.y());
    Sampler sampler(2.0 * areas.sum(), count);
    for (int axis = 0; axis < 3; ++axis) {
      for (const double side : {-0.5, 0.5}) {
        sampler.face(areas[axis], [&](const Eigen::Vector2d& at) {
          Eigen::Vector3d p;
          p[axis] = side * size[axis];
          p[(axis + 1) % 3] = (at.x() - 0.5) * size[(axis + 1) % 3];
          p[(axis + 2) % 3] = (at.y() - 0.5) * size[(axis + 2) % 3];
          return p;
        });
      }
    }
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d sign(corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5,
                                 corner & 4 ? 0.5 : -0.5);
      sampler.point(sign.cwiseProduct(size));
    }
    return sampler.take();
  }

  std::vector<SurfaceSample> operator()(const Sphere& sphere) const {
    return round(sphere.radius_m, 0.0);
  }
  std::vector<SurfaceSample> operator()(const Capsule& capsule) const {
    return round(capsule.radius_m, capsule.length_m);
  }

  std::vector<SurfaceSample> operator()(const Cylinder& cylinder) const {
    const double r = cylinder.radius_m;
    const double half = 0.5 * cylinder.length_m;
    const double side_m2 = 2.0 * pi * r * cylinder.length_m;
    const double end_m2 = pi * r * r;
    Sampler sampler(side_m2 + 2.0 * end_m2, count);
    sampler.face(side_m2, [&](const Eigen::Vector2d& at) {
      return on_circle(r, at.x(), (2.0 * at.y() - 1.0) * half);
    });
    for (const double z : {-half, half}) {
      sampler.face(end_m2, [&](const Eigen::Vector2d& at) {
        return on_circle(r * std::sqrt(at.y()), at.x(), z);
      });
      for (int i = 0; i < kRimPoints; ++i) sampler.point(on_circle(r, i / double{kRimPoints}, z));
    }
    return sampler.take();
  }

  std::vector<SurfaceSample> operator()(const HalfSpace&) const { return {}; }

  std::vector<SurfaceSample> operator()(const std::shared_ptr<const Mesh>& mesh) const {
    if (mesh == nullptr) return {};
    const auto corner = [&](const Eigen::Vector3i& triangle, int i) -> const Eigen::Vector3d& {
      return mesh->vertices_m[static_cast<std::size_t>(triangle[i])];
    };
    const auto area_m2 = [&](const Eigen::Vector3i& t) {
      return 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    };
    double total_m2 = 0.0;
    for (const Eigen::Vector3i& triangle : mesh->triangles) total_m2 += area_m2(triangle);
    Sampler sampler(total_m2, count);
    for (const Eigen::Vector3i& triangle : mesh->triangles) {
      sampler.face(area_m2(triangle), [&](const Eigen::Vector2d& at) {
        // The half of the square beyond the diagonal is turned over onto the other.
        const bool beyond = at.sum() > 1.0;
        const double u = beyond ? 1.0 - at.x() : at.x();
        const double v = beyond ? 1.0 - at.y() : at.y();
        const Eigen::Vector3d& a = corner(triangle, 0);
        return (a + u * (corner(triangle, 1) - a) + v * (corner(triangle, 2) - a)).eval();
      });
    }
    for (const Eigen::Vector3d& vertex : mesh->vertices_m) sampler.point(vertex);
    return sampler.take();
  }

 private:
  /// Half a sphere at both ends of a cylinder, which may be of no length.
  [[nodiscard]] std::vector<SurfaceSample> round(double r, double length) const {
    const double side_m2 = 2.0 * pi * r * length;
    const double cap_m2 = 2.0 * pi * r * r;
    Sampler sampler(side_m2 + 2.0 * cap_m2, count);
    if (side_m2 > 0.0) {
      sampler.face(side_m2, [&](const Eigen::Vector2d& at) {
        return on_circle(r, at.x(), (at.y() - 0.5) * length);
      });
    }
    for (const double side : {-1.0, 1.0}) {
      // Archimedes: equal heights, equal areas.
      sampler.face(cap_m2, [&](const Eigen::Vector2d& at) {
        const double height = r * at.y();
        const double around = std::sqrt(std::max(0.0, r * r - height * height));
        return on_circle(around, at.x(), side * (0.5 * length + height));
      });
      sampler.point({0.0, 0.0, side * (0.5 * length + r)});
    }
    return sampler.take();
  }
};

}  // namespace

ShapeBounds bounds_of(const Shape& shape) { return std::visit(Bounds{}, shape); }

const BodyLink* RigidBody::find(int link) const noexcept {
  const auto found = std::ranges::find(links, link, &BodyLink::link);
  return found == links.end() ? nullptr : &*found;
}

std::vector<RigidBody> rigid_bodies(const KinematicTree& robot) {
  const RobotDescription& description = robot.description();
  std::vector<RigidBody> bodies;
  std::vector<std::size_t> body_of_link(description.links.size());
  std::vector<Transform> T_body_link(description.links.size(), Transform::Identity());
  for (std::size_t link = 0; link < description.links.size(); ++link) {
    const TreeJoint& joint = robot.tree_joints()[link];
    const int parent = description.links[link].parent;
    if (parent == -1 || joint.motion != TreeJoint::Motion::kFixed) {
      body_of_link[link] = bodies.size();
      bodies.emplace_back();
    } else {
      body_of_link[link] = body_of_link[idx(parent)];
      T_body_link[link] = T_body_link[idx(parent)] * joint.T_parent_joint;
    }
    bodies[body_of_link[link]].links.push_back({static_cast<int>(link), T_body_link[link]});
  }
  for (const CollisionShape& one : description.shapes) {
    if (!has_volume(one.shape)) continue;
    const Transform T_body_shape = T_body_link[idx(one.link)] * one.T_link_shape;
    bodies[body_of_link[idx(one.link)]].parts.push_back(
        {one.link, one.shape, T_body_shape, T_body_shape.inverse()});
  }
  return bodies;
}

Eigen::Vector3d to_grain(const Eigen::Vector3d& p) {
  return (p * kGrainsPerMetre).array().round().matrix() / kGrainsPerMetre;
}

double up_to_grain(double radius_m) {
  return std::ceil(radius_m * kGrainsPerMetre - 1e-6) / kGrainsPerMetre;
}

double signed_distance_m(const RigidBody& body, const Eigen::Vector3d& p_body) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const BodyPart& part : body.parts) {
    nearest = std::min(nearest, signed_distance_m(part.shape, part.T_shape_body * p_body));
  }
  return nearest;
}

std::vector<BodySphere> spheres_of(const RigidBody& body,
                                   const std::vector<CollisionSphere>& spheres) {
  std::vector<BodySphere> own;
  for (const CollisionSphere& sphere : spheres) {
    const BodyLink* const link = body.find(sphere.link);
    if (link == nullptr) continue;
    own.push_back({sphere.link, link->T_body_link * sphere.centre_link_m, sphere.radius_m});
  }
  return own;
}

double signed_distance_m(const std::vector<BodySphere>& spheres, const Eigen::Vector3d& p_body) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const BodySphere& sphere : spheres) {
    nearest = std::min(nearest, (p_body - sphere.p_body).norm() - sphere.radius_m);
  }
  return nearest;
}

std::vector<SurfaceSample> surface_samples(const Shape& shape, std::size_t count) {
  return std::visit(Sample{count}, shape);
}

Eigen::Vector3d even_in_cube(std::size_t i) noexcept {
  constexpr double kRatio = 1.22074408460575947536;
  const double n = static_cast<double>(i) + 1.0;
  return {fraction(0.5 + n / kRatio), fraction(0.5 + n / (kRatio * kRatio)),
          fraction(0.5 + n / (kRatio * kRatio * kRatio))};
}

std::vector<Eigen::Vector3d> even_in_ball(std::size_t count) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(count);
  for (std::size_t i = 0; points.size() < count; ++i) {
    const Eigen::Vector3d p = 2.0 * even_in_cube(i) - Eigen::Vector3d::Ones();
    if (p.squaredNorm() <= 1.0) points.push_back(p);
  }
  return points;
}

std::vector<Eigen::Vector3d> even_on_sphere(std::size_t count) {
  std::vector<Eigen::Vector3d> directions;
  directions.reserve(count);
  const double golden_turn = std::numbers::phi - 1.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count);
    directions.push_back(
        on_circle(std::sqrt(1.0 - z * z), golden_turn * static_cast<double>(i), z));
  }
  return directions;
}

}  // namespace sidestep
