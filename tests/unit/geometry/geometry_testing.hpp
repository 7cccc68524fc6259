#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/geometry/shape.hpp>

namespace sidestep::testing {

/// One of each bounded analytic shape.
inline std::vector<Shape> bounded_shapes() {
  return {Box{{0.4, 1.0, 0.2}}, Sphere{0.35}, Cylinder{0.25, 0.9}, Capsule{0.2, 0.6}};
}

inline Eigen::Vector3d uniform_point(std::mt19937& random, double half_side_m) {
  std::uniform_real_distribution<double> uniform(-half_side_m, half_side_m);
  const double x = uniform(random);
  const double y = uniform(random);
  return {x, y, uniform(random)};
}

inline Eigen::Vector3d uniform_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return Eigen::Vector3d(x, y, normal(random)).normalized();
}

/// Points on a shape's surface, no further than about `step_m` from each other.
class SurfaceSamples {
 public:
  SurfaceSamples(const Shape& shape, double step_m) : step_m_(step_m) { std::visit(*this, shape); }

  void operator()(const Box& box) {
    const Eigen::Vector3d half = 0.5 * box.size_m;
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      for (const double s : steps(-half[u], half[u])) {
        for (const double t : steps(-half[v], half[v])) {
          Eigen::Vector3d p;
          p[u] = s;
          p[v] = t;
          p[axis] = half[axis];
          points.push_back(p);
          p[axis] = -half[axis];
          points.push_back(p);
        }
      }
    }
  }
  void operator()(const Sphere& sphere) { ball(sphere.radius_m, 0.0); }
  void operator()(const Cylinder& cylinder) {
    for (const double z : steps(-0.5 * cylinder.length_m, 0.5 * cylinder.length_m)) {
      ring(cylinder.radius_m, z);
    }
    for (const double r : steps(0.0, cylinder.radius_m)) {
      ring(r, 0.5 * cylinder.length_m);
      ring(r, -0.5 * cylinder.length_m);
    }
  }
  void operator()(const Capsule& capsule) {
    for (const double z : steps(-0.5 * capsule.length_m, 0.5 * capsule.length_m)) {
      ring(capsule.radius_m, z);
    }
    ball(capsule.radius_m, 0.5 * capsule.length_m);
  }
  void operator()(const HalfSpace&) {}
  void operator()(const std::shared_ptr<const Mesh>&) {}

  std::vector<Eigen::Vector3d> points;

 private:
  [[nodiscard]] std::vector<double> steps(double from, double to) const {
    const int count = static_cast<int>(std::ceil((to - from) / step_m_)) + 1;
    std::vector<double> values;
    for (int i = 0; i <= count; ++i) values.push_back(from + (to - from) * i / count);
    return values;
  }
  void ring(double radius_m, double z_m) {
    for (const double s : steps(0.0, 2.0 * std::numbers::pi * radius_m)) {
      const double angle = radius_m > 0.0 ? s / radius_m : 0.0;
      points.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle), z_m);
    }
  }
  /// Two half balls, pulled apart by `offset_m` up and down.
  void ball(double radius_m, double offset_m) {
    for (const double s : steps(0.0, 0.5 * std::numbers::pi * radius_m)) {
      const double latitude = s / radius_m;
      const double z = offset_m + radius_m * std::sin(latitude);
      ring(radius_m * std::cos(latitude), z);
      ring(radius_m * std::cos(latitude), -z);
    }
  }

  double step_m_;
};

/// Whether a point lies inside, told from the shape's definition.
inline bool inside(const Shape& shape, const Eigen::Vector3d& p) {
  struct Inside {
    const Eigen::Vector3d& p;
    bool operator()(const Box& box) const {
      return (2.0 * p.cwiseAbs().array() < box.size_m.array()).all();
    }
    bool operator()(const Sphere& sphere) const { return p.norm() < sphere.radius_m; }
    bool operator()(const Cylinder& cylinder) const {
      return std::hypot(p.x(), p.y()) < cylinder.radius_m &&
             2.0 * std::abs(p.z()) < cylinder.length_m;
    }
    bool operator()(const Capsule& capsule) const {
      const double beyond = std::max(std::abs(p.z()) - 0.5 * capsule.length_m, 0.0);
      return std::hypot(p.x(), p.y(), beyond) < capsule.radius_m;
    }
    bool operator()(const HalfSpace&) const { return p.z() < 0.0; }
    bool operator()(const std::shared_ptr<const Mesh>&) const { return false; }
  };
  return std::visit(Inside{p}, shape);
}

}  // namespace sidestep::testing
