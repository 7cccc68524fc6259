#pragma once

#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "rigid_body.hpp"

namespace sidestep::testing_support {

/// A robot of one link with these shapes.
inline std::vector<RigidBody> one_body(std::vector<Shape> shapes) {
  RobotDescription robot;
  robot.name = "one";
  robot.links = {{"world", -1}, {"body", 0}};
  robot.joints = {{"slide", Joint::Type::kPrismatic, -1.0, 1.0, 1.0, 1.0}};
  for (Shape& shape : shapes) robot.shapes.push_back({1, std::move(shape), Transform::Identity()});
  TreeJoint slide{"slide", TreeJoint::Motion::kTranslation};
  slide.joint = 0;
  const auto tree = KinematicTree::create(robot, {TreeJoint{"world"}, slide});
  EXPECT_TRUE(tree);
  return rigid_bodies(**tree);
}

inline double ball_m3(double radius_m) {
  return 4.0 / 3.0 * std::numbers::pi * radius_m * radius_m * radius_m;
}

/// A cap of a ball, of this height.
inline double cap_m3(double radius_m, double height_m) {
  return std::numbers::pi * height_m * height_m * (3.0 * radius_m - height_m) / 3.0;
}

}  // namespace sidestep::testing_support
