#include "convex.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <variant>

#include <Eigen/Geometry>

namespace sidestep {
namespace {

constexpr double kOverlap_m = 1e-9;
constexpr int kSteps = 60;
/// What a direction may lose where it is rounded, of shapes of some metres.
constexpr double kRoundedDirection = 1e-3;

Eigen::Vector3d farthest_in(const Box& box, const Eigen::Vector3d& d) {
  return 0.5 *
         box.size_m.cwiseProduct(d.unaryExpr([](double x) { return x < 0.0 ? -1.0 : 1.0; }).eval());
}
Eigen::Vector3d farthest_in(const Sphere& ball, const Eigen::Vector3d& d) {
  return ball.radius_m * d.stableNormalized();
}
double cap(double length_m, const Eigen::Vector3d& d) {
  return d.z() < 0.0 ? -0.5 * length_m : 0.5 * length_m;
}
Eigen::Vector3d farthest_in(const Cylinder& cylinder, const Eigen::Vector3d& d) {
  const Eigen::Vector2d side = cylinder.radius_m * d.head<2>().stableNormalized();
  return {side.x(), side.y(), cap(cylinder.length_m, d)};
}
Eigen::Vector3d farthest_in(const Capsule& capsule, const Eigen::Vector3d& d) {
  return Eigen::Vector3d(0.0, 0.0, cap(capsule.length_m, d)) +
         capsule.radius_m * d.stableNormalized();
}
Eigen::Vector3d farthest_in(const HalfSpace&, const Eigen::Vector3d&) {
  return Eigen::Vector3d::Zero();
}
Eigen::Vector3d farthest_in(const std::shared_ptr<const Mesh>& mesh, const Eigen::Vector3d& d) {
  return *std::ranges::max_element(mesh->vertices_m, {},
                                   [&](const Eigen::Vector3d& p) { return d.dot(p); });
}

double reach_of(const Box& box) { return 0.5 * box.size_m.norm(); }
double reach_of(const Sphere& ball) { return ball.radius_m; }
double reach_of(const Cylinder& c) { return std::hypot(c.radius_m, 0.5 * c.length_m); }
double reach_of(const Capsule& c) { return c.radius_m + 0.5 * c.length_m; }
double reach_of(const HalfSpace&) { return std::numeric_limits<double>::infinity(); }
double reach_of(const std::shared_ptr<const Mesh>& mesh) {
  double most = 0.0;
  for (const Eigen::Vector3d& p : mesh->vertices_m) most = std::max(most, p.norm());
  return most;
}

/// A point of b - a, and the two that it comes from.
struct Difference {
  Eigen::Vector3d p, of_a, of_b;
};

Difference lowest(const PlacedShape& a, const PlacedShape& b, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d of_a = a.farthest(direction);
  const Eigen::Vector3d of_b = b.farthest(-direction);
  return {of_b - of_a, of_a, of_b};
}

struct Simplex {
  std::array<Difference, 4> points;
  std::array<double, 4> weights{};
  int size = 0;

  /// Sets the weights of the point of its plane (line, point) that is nearest to the origin; no
  /// numbers where it is flat.
  void weigh() {
    const Eigen::Vector3d& p = points[0].p;
    const auto edge = [&](int i) { return points[i].p - p; };
    Eigen::Vector3d w = Eigen::Vector3d::Zero();
    if (size == 2) {
      w[0] = -edge(1).dot(p) / edge(1).squaredNorm();
    } else if (size == 3) {
      const double aa = edge(1).squaredNorm(), bb = edge(2).squaredNorm();
      const double ab = edge(1).dot(edge(2)), det = aa * bb - ab * ab;
      const double ap = -edge(1).dot(p), bp = -edge(2).dot(p);
      w[0] = (bb * ap - ab * bp) / det;
      w[1] = (aa * bp - ab * ap) / det;
    } else if (size == 4) {
      const Eigen::Vector3d bc = edge(2).cross(edge(3)), ca = edge(3).cross(edge(1));
      const Eigen::Vector3d ab = edge(1).cross(edge(2));
      w = -Eigen::Vector3d(bc.dot(p), ca.dot(p), ab.dot(p)) / edge(1).dot(bc);
    }
    weights = {1.0 - w.sum(), w[0], w[1], w[2]};
  }
  [[nodiscard]] Eigen::Vector3d mean(Eigen::Vector3d Difference::*of) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int i = 0; i < size; ++i) sum += weights[i] * (points[i].*of);
    return sum;
  }
};

/// The part of a simplex that has its point nearest to the origin inside, with that point's
/// weights.
Simplex nearest_part(const Simplex& simplex) {
  Simplex best;
  double least = std::numeric_limits<double>::infinity();
  for (int subset = 1; subset < 1 << simplex.size; ++subset) {
    Simplex part;
    for (int i = 0; i < simplex.size; ++i) {
      if ((subset >> i & 1) != 0) part.points[part.size++] = simplex.points[i];
    }
    part.weigh();
    const auto weights = std::span(part.weights).first(part.size);
    if (!std::ranges::all_of(weights, [](double w) { return w >= 0.0; })) continue;
    const double distance = part.mean(&Difference::p).squaredNorm();
    if (distance >= least) continue;
    least = distance;
    best = part;
  }
  return best;
}

}  // namespace

Eigen::Vector3d PlacedShape::farthest(const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d d = T_world_shape.linear().transpose() * direction;
  return T_world_shape *
         std::visit([&](const auto& of) -> Eigen::Vector3d { return farthest_in(of, d); }, *shape);
}

double reach_m(const Shape& shape) {
  return std::visit([](const auto& of) { return reach_of(of); }, shape);
}

double gap_m(const PlacedShape& a, const PlacedShape& b, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d n = direction.normalized();
  if (std::holds_alternative<HalfSpace>(*b.shape)) {
    const Eigen::Vector3d up = b.T_world_shape.linear().col(2);
    return up.dot(a.farthest(-up) - b.T_world_shape.translation());
  }
  return n.dot(b.farthest(-n)) - n.dot(a.farthest(n));
}

NearestPoints nearest_points(const PlacedShape& a, const PlacedShape& b, double near_m,
                             double wanted_m) {
  if (std::holds_alternative<HalfSpace>(*b.shape)) {
    const Eigen::Vector3d up = b.T_world_shape.linear().col(2);
    const Eigen::Vector3d p = a.farthest(-up);
    const double height_m = up.dot(p - b.T_world_shape.translation());
    return {p, p - std::max(0.0, height_m) * up, height_m <= 0.0};
  }
  Simplex simplex;
  simplex.points[0] = lowest(a, b, b.T_world_shape.translation() - a.T_world_shape.translation());
  simplex.size = 1;
  simplex.weights[0] = 1.0;
  for (int step = 0; step < kSteps; ++step) {
    const Eigen::Vector3d v = simplex.mean(&Difference::p);
    const double distance_m = v.norm();
    if (distance_m < kOverlap_m || simplex.size == 4) break;
    if (distance_m > near_m && distance_m < wanted_m) break;  // they cannot be shown apart
    const Difference next = lowest(a, b, v);
    if (v.dot(next.p) > (wanted_m + kRoundedDirection) * distance_m) break;  // and here they are
    if (v.dot(v - next.p) <= 1e-12 * distance_m) break;
    simplex.points[simplex.size++] = next;
    Simplex nearer = nearest_part(simplex);
    if (nearer.size == 0 || !(nearer.mean(&Difference::p).norm() < distance_m)) {
      --simplex.size;
      break;
    }
    simplex = nearer;
  }
  const Eigen::Vector3d p_a = simplex.mean(&Difference::of_a);
  const Eigen::Vector3d p_b = simplex.mean(&Difference::of_b);
  return {p_a, p_b, (p_b - p_a).norm() < kOverlap_m};
}

}  // namespace sidestep
