#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep::testing_support {

/// A small robot with kinematics of its own, for tests that need one without a profile.
class ChainRobot final : public RobotModel {
 public:
  /// Link i turns about (or shifts along) `axis` after the fixed offset from its parent.
  struct Step {
    Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
    int joint = -1;
  };

  ChainRobot(RobotDescription description, std::vector<Step> steps)
      : description_(std::move(description)), steps_(std::move(steps)) {}

  [[nodiscard]] const RobotDescription& description() const noexcept override {
    return description_;
  }
  [[nodiscard]] RobotDescription& description() noexcept { return description_; }
  [[nodiscard]] std::vector<Step>& steps() noexcept { return steps_; }

  void link_poses(std::span<const double> q, std::span<Transform> T_world_link,
                  Scratch&) const override {
    for (std::size_t i = 0; i < steps_.size(); ++i) {
      const int parent = description_.links[i].parent;
      Transform pose =
          parent < 0 ? Transform::Identity() : T_world_link[static_cast<std::size_t>(parent)];
      pose.translate(steps_[i].offset_m);
      if (steps_[i].joint >= 0) {
        const auto j = static_cast<std::size_t>(steps_[i].joint);
        if (description_.joints[j].type == Joint::Type::kPrismatic) {
          pose.translate(q[j] * steps_[i].axis);
        } else {
          pose.rotate(Eigen::AngleAxisd(q[j], steps_[i].axis));
        }
      }
      T_world_link[i] = pose;
    }
  }

  void sphere_centres(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                      Scratch& scratch) const override {
    const std::size_t dof = description_.joints.size();
    const std::size_t spheres = description_.spheres.size();
    std::vector<Transform> poses(steps_.size());
    for (std::size_t b = 0; b * dof < q.size(); ++b) {
      link_poses(q.subspan(b * dof, dof), poses, scratch);
      for (std::size_t s = 0; s < spheres; ++s) {
        const CollisionSphere& sphere = description_.spheres[s];
        centres_m[b * spheres + s] =
            poses[static_cast<std::size_t>(sphere.link)] * sphere.centre_link_m;
      }
    }
  }

  void sphere_jacobians(std::span<const double> q, std::span<Eigen::Vector3d> centres_m,
                        std::span<Eigen::Vector3d> jacobians, Scratch& scratch) const override {
    const std::size_t dof = description_.joints.size();
    const std::size_t spheres = description_.spheres.size();
    std::vector<Transform> poses(steps_.size());
    sphere_centres(q, centres_m, scratch);
    for (std::size_t b = 0; b * dof < q.size(); ++b) {
      link_poses(q.subspan(b * dof, dof), poses, scratch);
      for (std::size_t s = 0; s < spheres; ++s) {
        Eigen::Vector3d* columns = jacobians.data() + (b * spheres + s) * dof;
        for (std::size_t j = 0; j < dof; ++j) columns[j].setZero();
        for (int i = description_.spheres[s].link; i >= 0;
             i = description_.links[static_cast<std::size_t>(i)].parent) {
          const Step& step = steps_[static_cast<std::size_t>(i)];
          if (step.joint < 0) continue;
          const Transform& pose = poses[static_cast<std::size_t>(i)];
          const Eigen::Vector3d axis = pose.linear() * step.axis;
          const auto j = static_cast<std::size_t>(step.joint);
          columns[j] +=
              description_.joints[j].type == Joint::Type::kPrismatic
                  ? axis
                  : Eigen::Vector3d(axis.cross(centres_m[b * spheres + s] - pose.translation()));
        }
      }
    }
  }

  void pull_back(std::span<const double> q, std::span<const LinkForce> forces,
                 std::span<double> joint_forces, Scratch& scratch) const override {
    const std::size_t dof = description_.joints.size();
    std::vector<Transform> poses(steps_.size());
    for (std::size_t k = 0; k < forces.size(); ++k) {
      const LinkForce& pull = forces[k];
      link_poses(q.subspan(static_cast<std::size_t>(pull.row) * dof, dof), poses, scratch);
      std::fill_n(joint_forces.begin() + static_cast<std::ptrdiff_t>(k * dof), dof, 0.0);
      for (int i = pull.link; i >= 0; i = description_.links[static_cast<std::size_t>(i)].parent) {
        const Step& step = steps_[static_cast<std::size_t>(i)];
        if (step.joint < 0) continue;
        const Transform& pose = poses[static_cast<std::size_t>(i)];
        const Eigen::Vector3d axis = pose.linear() * step.axis;
        const auto j = static_cast<std::size_t>(step.joint);
        joint_forces[k * dof + j] =
            description_.joints[j].type == Joint::Type::kPrismatic
                ? axis.dot(pull.force)
                : axis.dot(pull.moment - pose.translation().cross(pull.force));
      }
    }
  }

 private:
  RobotDescription description_;
  std::vector<Step> steps_;
};

/// One sphere that moves in x, y and z within +-3 m.
[[nodiscard]] inline std::shared_ptr<ChainRobot> flying_ball(double radius_m) {
  RobotDescription d;
  d.name = "ball";
  std::vector<ChainRobot::Step> steps;
  const char* names[] = {"x", "y", "z"};
  for (int i = 0; i < 3; ++i) {
    d.joints.push_back({names[i], Joint::Type::kPrismatic, -3.0, 3.0, 2.0,
                        std::numeric_limits<double>::infinity()});
    d.links.push_back({i == 2 ? "ball" : std::string("ball_") + names[i], i - 1});
    steps.push_back({Eigen::Vector3d::Zero(), Eigen::Vector3d::Unit(i), i});
  }
  d.spheres.push_back({2, Eigen::Vector3d::Zero(), radius_m});
  d.shapes.push_back({2, Sphere{radius_m}, Transform::Identity()});
  return std::make_shared<ChainRobot>(std::move(d), std::move(steps));
}

/// A holonomic base with a lift and an arm of three joints: 7 degrees of freedom, 10 spheres.
[[nodiscard]] inline std::shared_ptr<ChainRobot> mobile_arm() {
  using Type = Joint::Type;
  RobotDescription d;
  d.name = "mobile_arm";
  d.joints = {{"x", Type::kPrismatic, -kInfinity, kInfinity, 0.8, kInfinity},
              {"y", Type::kPrismatic, -kInfinity, kInfinity, 0.8, kInfinity},
              {"theta", Type::kContinuous, -kInfinity, kInfinity, 1.5, kInfinity},
              {"lift", Type::kPrismatic, 0.0, 0.4, 0.3, kInfinity},
              {"shoulder", Type::kRevolute, -2.6, 0.5, 1.2, kInfinity},
              {"elbow", Type::kRevolute, -2.2, 2.2, 1.5, kInfinity},
              {"wrist", Type::kRevolute, -1.9, 1.9, 2.0, kInfinity}};
  d.links = {{"odom", -1}, {"base_x", 0},    {"base_y", 1},   {"base", 2},
             {"mast", 3},  {"upper_arm", 4}, {"fore_arm", 5}, {"hand", 6}};
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  std::vector<ChainRobot::Step> steps = {{{0, 0, 0}, z, -1},     {{0, 0, 0}, x, 0},
                                         {{0, 0, 0}, y, 1},      {{0, 0, 0}, z, 2},
                                         {{0.1, 0, 0.4}, z, 3},  {{0.1, 0.05, 0.1}, y, 4},
                                         {{0.0, 0, 0.35}, y, 5}, {{0.0, 0, 0.3}, x, 6}};
  d.spheres = {{3, {0.08, 0, 0.2}, 0.2},  {3, {-0.08, 0, 0.2}, 0.2}, {4, {0, 0, 0}, 0.12},
               {5, {0, 0, 0.1}, 0.07},    {5, {0, 0, 0.25}, 0.07},   {6, {0, 0, 0.08}, 0.06},
               {6, {0, 0, 0.2}, 0.06},    {7, {0, 0, 0.0}, 0.05},    {7, {0, 0.03, 0.1}, 0.04},
               {7, {0, -0.03, 0.1}, 0.04}};
  d.self_collision_pairs = {{3, 6}, {3, 7}, {4, 7}};
  return std::make_shared<ChainRobot>(std::move(d), std::move(steps));
}

}  // namespace sidestep::testing_support
