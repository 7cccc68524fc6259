#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/robot/sphere_fit.hpp>

namespace sidestep {
namespace {

using Point = Eigen::Vector3d;
using Distance = std::function<double(const Point&)>;

/// From a triangle, by the nearest of its plane's foot, its edges and its corners.
double distance_to_triangle(const std::array<Point, 3>& t, const Point& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    const Point edge = t[(i + 1) % 3] - t[i];
    const double along = std::clamp((p - t[i]).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - t[i] - along * edge).norm());
  }
  Eigen::Matrix<double, 3, 2> sides;
  sides << t[1] - t[0], t[2] - t[0];
  const Eigen::Vector2d foot =
      (sides.transpose() * sides).ldlt().solve(sides.transpose() * (p - t[0]));
  if (foot.minCoeff() >= 0.0 && foot.sum() <= 1.0) {
    nearest = std::min(nearest, (p - t[0] - sides * foot).norm());
  }
  return nearest;
}

std::vector<std::array<Point, 3>> triangles_of(const Mesh& mesh) {
  std::vector<std::array<Point, 3>> all;
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    all.push_back({mesh.vertices_m[static_cast<std::size_t>(triangle[0])],
                   mesh.vertices_m[static_cast<std::size_t>(triangle[1])],
                   mesh.vertices_m[static_cast<std::size_t>(triangle[2])]});
  }
  return all;
}

/// To the triangles, whichever side they are looked at from; 0 where `inside` says so.
Distance brute_force(const Mesh& mesh, const std::function<bool(const Point&)>& inside) {
  return [all = triangles_of(mesh), inside](const Point& p) {
    if (inside(p)) return 0.0;
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& triangle : all) nearest = std::min(nearest, distance_to_triangle(triangle, p));
    return nearest;
  };
}

bool is_within(const Point& p, const Point& low, const Point& high) {
  return (p - low).minCoeff() >= 0.0 && (high - p).minCoeff() >= 0.0;
}

/// Adds a flat polygon, which turns left as seen from outside and is star-shaped from its first
/// corner.
void add_face(const std::vector<Point>& corners, Mesh& mesh) {
  const int first = static_cast<int>(mesh.vertices_m.size());
  mesh.vertices_m.insert(mesh.vertices_m.end(), corners.begin(), corners.end());
  for (int i = 2; i < static_cast<int>(corners.size()); ++i) {
    mesh.triangles.emplace_back(first, first + i - 1, first + i);
  }
}

/// A prism over a polygon in the plane of x and y, from z = 0.
Mesh prism(const std::vector<Eigen::Vector2d>& outline, double height_m) {
  Mesh mesh;
  std::vector<Point> low, high;
  for (const Eigen::Vector2d& p : outline) {
    low.insert(low.begin(), Point(p.x(), p.y(), 0.0));
    high.emplace_back(p.x(), p.y(), height_m);
  }
  std::rotate(low.begin(), low.end() - 1, low.end());  // the same first corner
  add_face(low, mesh);
  add_face(high, mesh);
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Point a = high[i], b = high[(i + 1) % high.size()];
    const Point down(0.0, 0.0, -height_m);
    add_face({a + down, b + down, b, a}, mesh);
  }
  return mesh;
}

/// The lower half of a sphere, as a surface of no thickness.
Mesh bowl(double radius_m) {
  Mesh mesh;
  constexpr int kAround = 24, kDown = 8;
  const auto at = [&](int i, int j) {
    const double turn = 2.0 * M_PI * i / kAround, fall = 0.5 * M_PI * j / kDown;
    return Point(radius_m * std::cos(turn) * std::cos(fall),
                 radius_m * std::sin(turn) * std::cos(fall), -radius_m * std::sin(fall));
  };
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j + 1 < kDown; ++j) {
      add_face({at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)}, mesh);
    }
    add_face({at(i, kDown - 1), at(0, kDown), at(i + 1, kDown - 1)}, mesh);
  }
  return mesh;
}

struct Case {
  const char* name;
  Shape shape;
  double protrusion_m;
  Distance outside_m;  ///< How far a point lies outside of the shape.
  friend void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }
};

Case box_case(const char* name, const Point& size, double protrusion_m) {
  return {name, Box{size}, protrusion_m,
          [size](const Point& p) { return (p.cwiseAbs() - 0.5 * size).cwiseMax(0.0).norm(); }};
}

Case cylinder_case(const char* name, double radius_m, double length_m, double protrusion_m) {
  return {name, Cylinder{radius_m, length_m}, protrusion_m, [=](const Point& p) {
            return std::hypot(std::max(0.0, std::hypot(p.x(), p.y()) - radius_m),
                              std::max(0.0, std::abs(p.z()) - 0.5 * length_m));
          }};
}

Case mesh_case(const char* name, const Mesh& mesh, double protrusion_m,
               const std::function<bool(const Point&)>& inside) {
  return {name, std::make_shared<const Mesh>(mesh), protrusion_m, brute_force(mesh, inside)};
}

std::vector<Case> cases() {
  const Mesh ell = prism({{0, 0}, {0.8, 0}, {0.8, 0.2}, {0.2, 0.2}, {0.2, 1.0}, {0, 1.0}}, 0.15);
  const auto in_ell = [](const Point& p) {
    return is_within(p, {0, 0, 0}, {0.8, 0.2, 0.15}) || is_within(p, {0, 0, 0}, {0.2, 1.0, 0.15});
  };
  const Mesh strip = prism({{0, 0}, {1.5, 0}, {1.5, 0.02}, {0, 0.02}}, 0.02);
  Mesh tilted = strip;  // its bounding box is large and empty
  const Eigen::AngleAxisd turn(0.7, Point(1.0, -1.0, 0.5).normalized());
  for (Point& vertex : tilted.vertices_m) vertex = turn * vertex;
  const auto in_strip = [](const Point& p) { return is_within(p, {0, 0, 0}, {1.5, 0.02, 0.02}); };
  const auto in_tilted = [=](const Point& p) { return in_strip(turn.inverse() * p); };
  const auto nowhere = [](const Point&) { return false; };
  Mesh inverted_ell = ell;
  for (Eigen::Vector3i& triangle : inverted_ell.triangles) std::swap(triangle[0], triangle[1]);
  Mesh open_ell = ell;
  open_ell.triangles.erase(open_ell.triangles.begin());
  return {mesh_case("ell", ell, 0.05, in_ell),
          mesh_case("ell_fine", ell, 0.02, in_ell),
          mesh_case("inverted_ell", inverted_ell, 0.05, in_ell),
          mesh_case("inverted_ell_fine", inverted_ell, 0.02, in_ell),
          mesh_case("open_ell", open_ell, 0.05, nowhere),
          mesh_case("strip", strip, 0.02, in_strip),
          mesh_case("tilted_strip", tilted, 0.05, in_tilted),
          mesh_case("bowl", bowl(0.3), 0.05, nowhere),
          box_case("tray", {0.9, 0.6, 0.02}, 0.03),
          box_case("cube", {1.0, 1.0, 1.0}, 0.05),
          box_case("pole", {0.05, 0.05, 1.0}, 0.02),
          cylinder_case("disc", 0.3, 0.02, 0.05),
          cylinder_case("drum", 0.4, 0.5, 0.05),
          cylinder_case("rod", 0.03, 1.0, 0.01),
          {"capsule", Capsule{0.05, 0.6}, 0.01, [](const Point& p) {
             const Point on_axis(0.0, 0.0, std::clamp(p.z(), -0.3, 0.3));
             return std::max(0.0, (p - on_axis).norm() - 0.05);
           }}};
}

/// Points all over the surface of a shape's triangles, corners and edges included.
std::vector<Point> surface_points(const Shape& shape, std::mt19937_64& random) {
  const Mesh mesh = triangulate(shape);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Point> points = mesh.vertices_m;
  double area = 0.0;
  const auto all = triangles_of(mesh);
  const auto area_of = [](const auto& t) { return (t[1] - t[0]).cross(t[2] - t[0]).norm(); };
  for (const auto& triangle : all) area += area_of(triangle);
  for (const auto& triangle : all) {
    const int count = 3 + static_cast<int>(20000 * area_of(triangle) / area);
    for (int i = 0; i < count; ++i) {
      double u = unit(random), v = unit(random);
      if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
      if (i == 0) v = 0.0;  // on an edge
      points.push_back(triangle[0] + u * (triangle[1] - triangle[0]) +
                       v * (triangle[2] - triangle[0]));
    }
  }
  return points;
}

/// Points within a shape, spread over the box that bounds it.
std::vector<Point> inner_points(const Case& one, std::mt19937_64& random) {
  Eigen::AlignedBox3d bounds;
  for (const Point& vertex : triangulate(one.shape).vertices_m) bounds.extend(vertex);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Point> points;
  for (int i = 0; i < 3000; ++i) {
    const Point share(unit(random), unit(random), unit(random));
    const Point p = bounds.min() + share.cwiseProduct(bounds.sizes());
    if (one.outside_m(p) == 0.0) points.push_back(p);
  }
  return points;
}

class SphereFit : public ::testing::TestWithParam<Case> {};

TEST_P(SphereFit, HoldsTheShapeAndStandsOutNoFartherThanItIsAllowed) {
  const Case& one = GetParam();
  CollisionShape shape{3, one.shape};
  shape.T_link_shape.translate(Point(0.3, -0.2, 0.1));
  shape.T_link_shape.rotate(Eigen::AngleAxisd(0.4, Point(0.0, 0.6, 0.8)));
  const auto spheres = fit_spheres(shape, one.protrusion_m);
  ASSERT_TRUE(spheres) << spheres.error().describe();
  ASSERT_FALSE(spheres->empty());
  RecordProperty("spheres", static_cast<int>(spheres->size()));
  std::mt19937_64 random(7);
  std::vector<Point> points = surface_points(one.shape, random);
  for (const Point& p : inner_points(one, random)) points.push_back(p);
  for (const Point& p : points) {
    const Point p_link = shape.T_link_shape * p;
    double gap = std::numeric_limits<double>::infinity();
    for (const CollisionSphere& sphere : *spheres) {
      gap = std::min(gap, (sphere.centre_link_m - p_link).norm() - sphere.radius_m);
    }
    ASSERT_LE(gap, 1e-9) << p.transpose();
  }
  std::normal_distribution<double> normal;
  const Transform T_shape_link = shape.T_link_shape.inverse();
  for (const CollisionSphere& sphere : *spheres) {
    EXPECT_EQ(sphere.link, 3);
    double out = one.outside_m(T_shape_link * sphere.centre_link_m);
    for (int i = 0; i < 60; ++i) {
      const Point direction = Point(normal(random), normal(random), normal(random)).normalized();
      const Point p_link = sphere.centre_link_m + sphere.radius_m * direction;
      out = std::max(out, one.outside_m(T_shape_link * p_link));
    }
    ASSERT_LE(out, one.protrusion_m + 1e-6) << sphere.radius_m;
  }
}

INSTANTIATE_TEST_SUITE_P(All, SphereFit, ::testing::ValuesIn(cases()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(SphereFitRefusals, SayWhatWouldNotDo) {
  const auto refused = fit_spheres({0, Box{{1.0, 1.0, 1.0}}}, 0.001);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("more than 2000 spheres"), std::string::npos);
  EXPECT_NE(refused.error().message.find("0.001 m"), std::string::npos);
  for (const double wrong : {0.0, -0.1, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(fit_spheres({0, Box{{1.0, 1.0, 1.0}}}, wrong)) << wrong;
  }
}

}  // namespace
}  // namespace sidestep
