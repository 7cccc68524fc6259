#pragma once

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::testing_robot {

/// Points of a bounded shape: dense on its surface, with edges and corners, and inside.
inline std::vector<Eigen::Vector3d> sample_shape(const Shape& shape, std::mt19937_64& generator) {
  const double kPitch = 0.004;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  const auto steps = [&](double length) { return std::max(2, static_cast<int>(length / kPitch)); };
  if (const auto* box = std::get_if<Box>(&shape)) {
    const Eigen::Vector3i n(steps(box->size_m.x()), steps(box->size_m.y()), steps(box->size_m.z()));
    for (int i = 0; i <= n.x(); ++i)
      for (int j = 0; j <= n.y(); ++j)
        for (int k = 0; k <= n.z(); ++k) {
          const Eigen::Vector3d part(double(i) / n.x() - 0.5, double(j) / n.y() - 0.5,
                                     double(k) / n.z() - 0.5);
          points.push_back(part.cwiseProduct(box->size_m));
        }
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    const int around = 720;
    const int up = steps(cylinder->length_m);
    const int out = steps(cylinder->radius_m);
    for (int k = 0; k <= up; ++k) {
      const double z = (double(k) / up - 0.5) * cylinder->length_m;
      const bool end = k == 0 || k == up;
      for (int a = 0; a < around; ++a) {
        const double angle = 2.0 * M_PI * a / around;
        for (int i = end || a % 30 == 0 ? 0 : out; i <= out; ++i) {
          const double r = cylinder->radius_m * i / out;
          points.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
        }
      }
    }
  } else if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    std::normal_distribution<double> normal;
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3d direction(normal(generator), normal(generator), normal(generator));
      points.push_back(direction.normalized() * sphere->radius_m *
                       (i % 4 == 0 ? unit(generator) : 1));
    }
  } else {
    ADD_FAILURE() << "no samples for a " << shape_name(shape);
  }
  return points;
}

/// Whether q never moves one link against the other.
inline bool rigidly_attached(const KinematicTree& tree, int a, int b) {
  const auto body = [&](int link) {
    while (link > 0 && tree.tree_joints()[static_cast<std::size_t>(link)].joint == -1)
      link = tree.description().links[static_cast<std::size_t>(link)].parent;
    return link;
  };
  return body(a) == body(b);
}

struct CoverReport {
  double deepest_gap_m = -std::numeric_limits<double>::infinity();  ///< Negative: all covered.
  std::string gap_link;
  double protrusion_m = 0.0;  ///< How far a sphere stands out from all shapes of its body.
  std::string protrusion_link;
  double volume_ratio = 0.0;  ///< Volume of the spheres' union over that of the shapes'.
};

/// Samples how well the spheres of a robot cover its shapes.
inline CoverReport measure_cover(const KinematicTree& tree, std::uint64_t seed = 1) {
  const RobotDescription& robot = tree.description();
  std::mt19937_64 generator(seed);
  Scratch scratch;
  const std::vector<double> q(robot.joints.size(), 0.0);
  std::vector<Transform> T(robot.links.size());
  tree.link_poses(q, T, scratch);
  const auto pose = [&](int link) { return T[static_cast<std::size_t>(link)]; };
  const auto name = [&](int link) { return robot.links[static_cast<std::size_t>(link)].name; };
  CoverReport report;
  for (const CollisionShape& shape : robot.shapes) {
    for (const Eigen::Vector3d& p : sample_shape(shape.shape, generator)) {
      const Eigen::Vector3d p_world = pose(shape.link) * shape.T_link_shape * p;
      double nearest = std::numeric_limits<double>::infinity();
      for (const CollisionSphere& sphere : robot.spheres) {
        if (!rigidly_attached(tree, sphere.link, shape.link)) continue;
        const double gap =
            (pose(sphere.link) * sphere.centre_link_m - p_world).norm() - sphere.radius_m;
        nearest = std::min(nearest, gap);
      }
      if (nearest > report.deepest_gap_m) {
        report.deepest_gap_m = nearest;
        report.gap_link = name(shape.link);
      }
    }
  }
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  double inside = 0.0, covered = 0.0;
  for (const CollisionSphere& sphere : robot.spheres) {
    double volume_points = 0.0, volume_inside = 0.0;
    for (int i = 0; i < 4000; ++i) {
      Eigen::Vector3d direction(normal(generator), normal(generator), normal(generator));
      direction.normalize();
      const auto distance = [&](double r) {
        const Eigen::Vector3d p_world = pose(sphere.link) * (sphere.centre_link_m + r * direction);
        double nearest = std::numeric_limits<double>::infinity();
        int multiplicity = 0;
        for (const CollisionShape& shape : robot.shapes) {
          if (!rigidly_attached(tree, sphere.link, shape.link)) continue;
          const Transform T_world_shape = pose(shape.link) * shape.T_link_shape;
          nearest =
              std::min(nearest, signed_distance_m(shape.shape, T_world_shape.inverse() * p_world));
        }
        for (const CollisionSphere& other : robot.spheres) {
          if (!rigidly_attached(tree, sphere.link, other.link)) continue;
          if ((pose(other.link) * other.centre_link_m - p_world).norm() <= other.radius_m + 1e-9)
            ++multiplicity;
        }
        return std::pair(nearest, std::max(1, multiplicity));
      };
      if (const double out = distance(sphere.radius_m).first; out > report.protrusion_m) {
        report.protrusion_m = out;
        report.protrusion_link = name(sphere.link);
      }
      const auto [nearest, multiplicity] = distance(sphere.radius_m * std::cbrt(unit(generator)));
      volume_points += 1.0 / multiplicity;
      if (nearest <= 0.0) volume_inside += 1.0 / multiplicity;
    }
    const double r = sphere.radius_m;
    covered += r * r * r * volume_points;
    inside += r * r * r * volume_inside;
  }
  report.volume_ratio = covered / inside;
  return report;
}

/// The smallest distance between spheres of pairs that are checked against each other.
inline double self_clearance_m(const RobotModel& model, std::span<const double> q,
                               std::string* where = nullptr) {
  const RobotDescription& robot = model.description();
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  Scratch scratch;
  model.sphere_centres(q, centres, scratch);
  double nearest = std::numeric_limits<double>::infinity();
  for (const auto& [a, b] : robot.self_collision_pairs) {
    for (std::size_t s = 0; s < centres.size(); ++s) {
      for (std::size_t t = 0; t < centres.size(); ++t) {
        const CollisionSphere& first = robot.spheres[s];
        const CollisionSphere& second = robot.spheres[t];
        if (first.link != a || second.link != b) continue;
        const double gap = (centres[s] - centres[t]).norm() - first.radius_m - second.radius_m;
        if (gap < nearest) {
          nearest = gap;
          if (where != nullptr)
            *where = robot.links[static_cast<std::size_t>(a)].name + " - " +
                     robot.links[static_cast<std::size_t>(b)].name;
        }
      }
    }
  }
  return nearest;
}

}  // namespace sidestep::testing_robot
