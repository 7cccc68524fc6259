#pragma once

#include <algorithm>

#include <sidestep/robot/robot_model.hpp>

namespace sidestep::testing_support {

/// One ball that moves freely: three prismatic joints are its centre.
class BallRobot : public RobotModel {
 public:
  explicit BallRobot(double radius_m) {
    description_.name = "ball";
    for (const char* name : {"x", "y", "z"}) {
      description_.joints.push_back({name, Joint::Type::kPrismatic, -10.0, 10.0, 1.0, 1.0});
    }
    description_.links.push_back({"ball", -1});
    description_.spheres.push_back({0, Eigen::Vector3d::Zero(), radius_m});
  }

  [[nodiscard]] const RobotDescription& description() const noexcept override {
    return description_;
  }
  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch&) const override {
    T_world_link[0] = Transform::Identity();
    T_world_link[0].translation() = Eigen::Map<const Eigen::Vector3d>(q.data());
  }
  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch&) const override {
    for (std::size_t b = 0; b < centres_m.size(); ++b) {
      centres_m[b] = Eigen::Map<const Eigen::Vector3d>(q.data() + 3 * b);
    }
  }
  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    sphere_centres(q, centres_m, scratch);
    for (std::size_t c = 0; c < jacobians.size(); ++c) {
      jacobians[c] = Eigen::Vector3d::Unit(static_cast<int>(c % 3));
    }
  }
  void pull_back(std::span<const double>, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch&) const override {
    for (std::size_t k = 0; k < forces.size(); ++k) {
      Eigen::Map<Eigen::Vector3d>(joint_forces.data() + 3 * k) = forces[k].force;
    }
  }

 protected:
  RobotDescription description_;
};

}  // namespace sidestep::testing_support
