#include "shape_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kNudge = 0.05;  // m, rad
constexpr double kLeastInterval = 1e-7;

/// de Casteljau: the control values of the parts below and above u.
template <std::size_t n>
std::pair<std::array<double, n>, std::array<double, n>> split(std::array<double, n> controls,
                                                              double u) {
  std::array<double, n> below{};
  std::array<double, n> above{};
  for (std::size_t level = 0; level < n; ++level) {
    below[level] = controls[0];
    above[n - 1 - level] = controls[n - 1 - level];
    for (std::size_t i = 0; i + level + 1 < n; ++i) {
      controls[i] += u * (controls[i + 1] - controls[i]);
    }
  }
  return {below, above};
}

template <std::size_t n>
std::array<double, n> part(const std::array<double, n>& controls, double from, double to) {
  const auto upper = split(controls, from).second;
  if (to >= 1.0) return upper;
  return split(upper, (to - from) / (1.0 - from)).first;
}

struct Farthest {
  Transform T_link_shape;

  [[nodiscard]] double corner(const Eigen::Vector3d& half) const {
    double farthest = 0.0;
    for (int c = 0; c < 8; ++c) {
      const Eigen::Vector3d corner((c & 1) != 0 ? half.x() : -half.x(),
                                   (c & 2) != 0 ? half.y() : -half.y(),
                                   (c & 4) != 0 ? half.z() : -half.z());
      farthest = std::max(farthest, (T_link_shape * corner).norm());
    }
    return farthest;
  }
  double operator()(const Box& box) const { return corner(0.5 * box.size_m); }
  double operator()(const Sphere& sphere) const {
    return T_link_shape.translation().norm() + sphere.radius_m;
  }
  double operator()(const Cylinder& cylinder) const {
    return corner({cylinder.radius_m, cylinder.radius_m, 0.5 * cylinder.length_m});
  }
  double operator()(const Capsule& capsule) const {
    const Eigen::Vector3d tip(0.0, 0.0, 0.5 * capsule.length_m);
    return std::max((T_link_shape * tip).norm(), (T_link_shape * -tip).norm()) + capsule.radius_m;
  }
  double operator()(const HalfSpace&) const { return std::numeric_limits<double>::infinity(); }
  double operator()(const std::shared_ptr<const Mesh>& mesh) const {
    double farthest = 0.0;
    for (const Eigen::Vector3d& vertex : mesh->vertices_m) {
      farthest = std::max(farthest, (T_link_shape * vertex).norm());
    }
    return farthest;
  }
};

}  // namespace

double farthest_point_m(const CollisionShape& shape) {
  return std::visit(Farthest{shape.T_link_shape}, shape.shape);
}

BezierJoint BezierJoint::between(double q0, double v0, double q1, double v1, double h_s) {
  BezierJoint joint;
  joint.position = {q0, q0 + v0 * h_s / 3.0, q1 - v1 * h_s / 3.0, q1};
  joint.velocity = {v0, 3.0 * (q1 - q0) / h_s - v0 - v1, v1};
  joint.acceleration = {2.0 * (joint.velocity[1] - v0) / h_s, 2.0 * (v1 - joint.velocity[1]) / h_s};
  return joint;
}

double BezierJoint::fastest(double from, double to) const {
  const auto controls = part(velocity, from, to);
  return std::max({std::abs(controls[0]), std::abs(controls[1]), std::abs(controls[2])});
}

template <std::size_t n>
BezierJoint::Excess BezierJoint::above(const std::array<double, n>& controls, double limit,
                                       double tolerance, double from, double to) {
  struct Piece {
    std::array<double, n> controls;
    double from;
    double to;
  };
  Excess worst;
  std::vector<Piece> open{{part(controls, from, to), from, to}};
  while (!open.empty()) {
    const Piece piece = open.back();
    open.pop_back();
    const double hull = *std::max_element(piece.controls.begin(), piece.controls.end()) - limit;
    if (hull <= std::max(tolerance, worst.amount)) continue;
    for (const auto& [value, u] : {std::pair{piece.controls.front(), piece.from},
                                   std::pair{piece.controls.back(), piece.to}}) {
      const double excess = value - limit;
      if (excess > tolerance && excess > worst.amount) worst = {excess, u};
    }
    if (piece.to - piece.from < kLeastInterval) continue;
    const double middle = 0.5 * (piece.from + piece.to);
    const auto [below, beyond] = split(piece.controls, 0.5);
    open.push_back({below, piece.from, middle});
    open.push_back({beyond, middle, piece.to});
  }
  return worst;
}

template BezierJoint::Excess BezierJoint::above(const std::array<double, 4>&, double, double,
                                                double, double);
template BezierJoint::Excess BezierJoint::above(const std::array<double, 3>&, double, double,
                                                double, double);
template BezierJoint::Excess BezierJoint::above(const std::array<double, 2>&, double, double,
                                                double, double);

ShapeMotion::ShapeMotion(const RobotModel& robot) : robot_(robot.description()) {
  const std::size_t links = robot_.links.size();
  const std::size_t joints = robot_.joints.size();
  radius_m_.assign(links, -1.0);
  for (const CollisionShape& shape : robot_.shapes) {
    radius_m_[idx(shape.link)] = std::max(radius_m_[idx(shape.link)], farthest_point_m(shape));
  }
  centre_radius_m_.assign(links, 0.0);
  for (const CollisionSphere& sphere : robot_.spheres) {
    double& radius_m = centre_radius_m_[idx(sphere.link)];
    radius_m = std::max(radius_m, sphere.centre_link_m.norm());
  }
  turn_rate_.assign(links * joints, 0.0);
  shift_rate_.assign(links * joints, 0.0);
  Scratch scratch;
  std::vector<double> q(joints);
  for (std::size_t j = 0; j < joints; ++j) {
    const Joint& joint = robot_.joints[j];
    q[j] = std::clamp(0.3, std::max(joint.lower, -1.0), std::min(joint.upper, 1.0));
  }
  std::vector<Transform> rest(links);
  std::vector<Transform> nudged(links);
  robot.link_poses(q, rest, scratch);
  const auto in_parent = [&](const std::vector<Transform>& poses, std::size_t link) {
    const int parent = robot_.links[link].parent;
    return parent < 0 ? poses[link] : Transform(poses[idx(parent)].inverse() * poses[link]);
  };
  for (std::size_t j = 0; j < joints; ++j) {
    std::vector<double> moved = q;
    moved[j] += kNudge;
    robot.link_poses(moved, nudged, scratch);
    for (std::size_t link = 0; link < links; ++link) {
      const Transform change = in_parent(rest, link).inverse() * in_parent(nudged, link);
      const Eigen::Quaterniond turned(change.linear());
      turn_rate_[link * joints + j] =
          Eigen::Quaterniond::Identity().angularDistance(turned) / kNudge;
      shift_rate_[link * joints + j] = change.translation().norm() / kNudge;
    }
  }
}

double ShapeMotion::link_way_m(int link, const std::vector<Transform>& from,
                               const std::vector<double>& ways, double limit_m, int other) const {
  if (radius_m_[idx(link)] < 0.0) return 0.0;
  return point_way_m(link, radius_m_[idx(link)], from, ways, limit_m, other);
}

double ShapeMotion::point_way_m(int link, double radius_m, const std::vector<Transform>& from,
                                const std::vector<double>& ways, double limit_m, int other) const {
  const auto carries_other = [&](int candidate) {
    for (int i = other; i >= 0; i = robot_.links[idx(i)].parent) {
      if (i == candidate) return true;
    }
    return false;
  };
  const std::size_t joints = ways.size();
  double way_m = 0.0;
  for (int k = link; k >= 0 && !carries_other(k); k = robot_.links[idx(k)].parent) {
    double turn_rad = 0.0;
    for (std::size_t j = 0; j < joints; ++j) {
      turn_rad += turn_rate_[idx(k) * joints + j] * ways[j];
      way_m += shift_rate_[idx(k) * joints + j] * ways[j];
    }
    const double arm_m =
        (from[idx(link)].translation() - from[idx(k)].translation()).norm() + radius_m;
    way_m += turn_rad * (arm_m + 2.0 * limit_m);
  }
  return way_m;
}

double ShapeMotion::robot_way_m(const std::vector<Transform>& from, const std::vector<double>& ways,
                                double limit_m) const {
  double way_m = 0.0;
  for (int link = 0; link < static_cast<int>(robot_.links.size()); ++link) {
    way_m = std::max(way_m, link_way_m(link, from, ways, limit_m));
  }
  return way_m;
}

double ShapeMotion::centres_way_m(const std::vector<Transform>& from,
                                  const std::vector<double>& ways, double limit_m) const {
  double way_m = 0.0;
  for (int link = 0; link < static_cast<int>(robot_.links.size()); ++link) {
    way_m =
        std::max(way_m, point_way_m(link, centre_radius_m_[idx(link)], from, ways, limit_m, -1));
  }
  return way_m;
}

}  // namespace sidestep
