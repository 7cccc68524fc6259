#pragma once

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/field/distance_field.hpp>
#include <sidestep/robot/robot_model.hpp>

/// Robots and fields in closed form, for tests that must not depend on the real ones.
namespace sidestep::conformance {

/// A chain of rotary links in the plane z = 0, on a base that may slide along x and y; or upright,
/// in the plane y = 0, on one that may slide along x and z.
class PlanarRobot final : public RobotModel {
 public:
  static constexpr double kLinkLength_m = 0.3;

  struct Shape {
    int rotary_joints = 2;
    bool mobile = false;
    int spheres_per_link = 3;
    double sphere_radius_m = 0.06;
    double range_rad = 2.8;      ///< Of every rotary joint, to both sides.
    double fastest_radps = 1.5;  ///< Velocity limit of every rotary joint.
    bool upright = false;        ///< Rotary joints lift what points along x.
  };

  explicit PlanarRobot(Shape shape) : shape_(shape) {
    description_.name = "planar_robot";
    if (shape.mobile) {
      description_.joints = {
          {"x", Joint::Type::kPrismatic, -5.0, 5.0, 1.0, kInfinity},
          {shape.upright ? "z" : "y", Joint::Type::kPrismatic, -5.0, 5.0, 1.0, kInfinity}};
    }
    description_.links.push_back({"base", -1});
    if (shape.mobile) description_.spheres.push_back({0, Eigen::Vector3d::Zero(), 0.15});
    for (int k = 1; k <= shape.rotary_joints; ++k) {
      description_.joints.push_back({"joint_" + std::to_string(k), Joint::Type::kRevolute,
                                     -shape.range_rad, shape.range_rad, shape.fastest_radps,
                                     kInfinity});
      description_.links.push_back({"link_" + std::to_string(k), k - 1});
      for (int s = 0; s < shape.spheres_per_link; ++s) {
        const double x = kLinkLength_m * (s + 0.5) / shape.spheres_per_link;
        description_.spheres.push_back({k, Eigen::Vector3d(x, 0, 0), shape.sphere_radius_m});
      }
      for (int other = 0; other + 2 <= k; ++other) {
        description_.self_collision_pairs.emplace_back(other, k);
      }
    }
  }

  [[nodiscard]] const RobotDescription& description() const noexcept override {
    return description_;
  }

  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch&) const override {
    for (std::size_t k = 0; k < T_world_link.size(); ++k) {
      T_world_link[k] = frame(q, static_cast<int>(k));
    }
  }

  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch&) const override {
    const std::size_t spheres = description_.spheres.size();
    const auto dof = static_cast<std::size_t>(description_.dof());
    for (std::size_t i = 0; i < centres_m.size(); ++i) {
      const CollisionSphere& sphere = description_.spheres[i % spheres];
      centres_m[i] = frame(q.subspan(i / spheres * dof, dof), sphere.link) * sphere.centre_link_m;
    }
  }

  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    sphere_centres(q, centres_m, scratch);
    const std::size_t spheres = description_.spheres.size();
    const auto dof = static_cast<std::size_t>(description_.dof());
    for (std::size_t i = 0; i < centres_m.size(); ++i) {
      const auto row = q.subspan(i / spheres * dof, dof);
      const int link = description_.spheres[i % spheres].link;
      for (std::size_t j = 0; j < dof; ++j) {
        jacobians[i * dof + j] = column(row, static_cast<int>(j), link, centres_m[i]);
      }
    }
  }

  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch&) const override {
    const auto dof = static_cast<std::size_t>(description_.dof());
    for (std::size_t k = 0; k < forces.size(); ++k) {
      const auto& [batch_row, link, force, moment] = forces[k];
      const auto row = q.subspan(static_cast<std::size_t>(batch_row) * dof, dof);
      for (std::size_t j = 0; j < dof; ++j) {
        const int joint = static_cast<int>(j);
        // Of the point of the link that is at the world's origin.
        const Eigen::Vector3d motion = column(row, joint, link, Eigen::Vector3d::Zero());
        joint_forces[k * dof + j] =
            motion.dot(force) + (turns(joint, link) ? axis().dot(moment) : 0.0);
      }
    }
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  [[nodiscard]] Transform frame(std::span<const double> q, int link) const {
    Transform T_world_link = Transform::Identity();
    const int first = shape_.mobile ? 2 : 0;
    if (shape_.mobile) T_world_link.translate(q[0] * slide(0) + q[1] * slide(1));
    for (int k = 1; k <= link; ++k) {
      if (k > 1) T_world_link.translate(Eigen::Vector3d(kLinkLength_m, 0, 0));
      T_world_link.rotate(Eigen::AngleAxisd(q[static_cast<std::size_t>(first + k - 1)], axis()));
    }
    return T_world_link;
  }

  [[nodiscard]] Eigen::Vector3d slide(int joint) const {
    return Eigen::Vector3d::Unit(joint == 1 && shape_.upright ? 2 : joint);
  }
  [[nodiscard]] Eigen::Vector3d axis() const { return slide(0).cross(slide(1)); }

  /// The first link that a joint turns.
  [[nodiscard]] int turned_by(int joint) const { return joint - (shape_.mobile ? 2 : 0) + 1; }
  [[nodiscard]] bool turns(int joint, int link) const {
    return turned_by(joint) >= 1 && turned_by(joint) <= link;
  }

  [[nodiscard]] Eigen::Vector3d column(std::span<const double> q, int joint, int link,
                                       const Eigen::Vector3d& centre_m) const {
    if (shape_.mobile && joint < 2) return slide(joint);
    if (!turns(joint, link)) return Eigen::Vector3d::Zero();
    return axis().cross(centre_m - frame(q, turned_by(joint)).translation());
  }

  Shape shape_;
  RobotDescription description_;
};

struct Ball {
  Eigen::Vector3d centre_m;
  double radius_m;
};

/// The exact signed distance to the nearest of some balls, in a cube about the origin. What
/// lies above `unknown_above_m` was never observed.
class BallField final : public DistanceField {
 public:
  explicit BallField(std::vector<Ball> balls, double half_side_m = 8.0,
                     double unknown_above_m = std::numeric_limits<double>::infinity())
      : DistanceField(make_info(half_side_m)),
        balls_(std::move(balls)),
        unknown_above_m_(unknown_above_m) {}

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override {
    const Eigen::Vector3d lower = info().grid.origin_m;
    const Eigen::Vector3d upper = info().grid.upper_m();
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      const Eigen::Vector3d p = points_m[i].cwiseMax(lower).cwiseMin(upper);
      distances_m[i] = std::numeric_limits<double>::infinity();
      if (!gradients.empty()) gradients[i].setZero();
      for (const Ball& ball : balls_) {
        const Eigen::Vector3d away = p - ball.centre_m;
        const double distance = away.norm() - ball.radius_m;
        if (distance >= distances_m[i]) continue;
        distances_m[i] = distance;
        if (!gradients.empty()) gradients[i] = away.normalized();
      }
      if (!statuses.empty()) {
        statuses[i] = p != points_m[i]           ? FieldStatus::kOutside
                      : p.z() > unknown_above_m_ ? FieldStatus::kUnknown
                                                 : FieldStatus::kKnown;
      }
    }
  }

 private:
  static FieldInfo make_info(double half_side_m) {
    FieldInfo info;
    info.grid.origin_m.setConstant(-half_side_m);
    info.grid.resolution_m = half_side_m / 32.0;
    info.grid.size_vox.setConstant(64);
    info.is_signed = true;
    info.max_distance_m = std::numeric_limits<double>::infinity();
    return info;
  }

  std::vector<Ball> balls_;
  double unknown_above_m_;
};

}  // namespace sidestep::conformance
