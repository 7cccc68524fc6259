#pragma once

#include <random>

#include <sidestep/certificates/certify.hpp>

namespace sidestep::testing_certify {

/// Straight from one configuration to the next, `step_s` each.
inline PolynomialMotion straight(const std::vector<std::vector<double>>& waypoints,
                                 double step_s = 1.0) {
  PolynomialMotion motion;
  for (std::size_t k = 0; k + 1 < waypoints.size(); ++k) {
    const double begin_s = step_s * static_cast<double>(k);
    PolynomialPiece piece{begin_s, step_s * static_cast<double>(k + 1), {}};
    for (std::size_t j = 0; j < waypoints[k].size(); ++j) {
      const double rate = (waypoints[k + 1][j] - waypoints[k][j]) / step_s;
      piece.coefficients.push_back({waypoints[k][j], rate});
    }
    motion.pieces.push_back(std::move(piece));
  }
  return motion;
}

inline SceneObject object(const std::string& name, Shape shape, const Eigen::Vector3d& p_m,
                          const Eigen::Vector3d& rpy_rad = Eigen::Vector3d::Zero()) {
  return {name, std::move(shape), {{0.0, transform_from_xyz_rpy(p_m, rpy_rad)}}};
}

/// Boxes, cylinders, balls and capsules within reach of an arm at the origin.
inline Scene random_scene(std::mt19937_64& random, int count) {
  const auto draw = [&](double lower, double upper) {
    return std::uniform_real_distribution(lower, upper)(random);
  };
  std::vector<SceneObject> objects;
  for (int i = 0; i < count; ++i) {
    const double bearing = draw(-3.1, 3.1), away = draw(0.35, 0.9);
    const Eigen::Vector3d p(away * std::cos(bearing), away * std::sin(bearing), draw(0.0, 1.0));
    const Eigen::Vector3d rpy(draw(-3, 3), draw(-3, 3), draw(-3, 3));
    const double r = draw(0.02, 0.12), l = draw(0.05, 0.3);
    const std::array<Shape, 4> shapes{Box{{r, l, draw(0.02, 0.3)}}, Cylinder{r, l}, Sphere{r},
                                      Capsule{r, l}};
    objects.push_back(object("o" + std::to_string(i), shapes[i % 4], p, rpy));
  }
  return Scene(std::move(objects));
}

/// An arm that turns about z and slides outwards, with these shapes.
inline std::shared_ptr<const KinematicTree> crane_of(std::vector<CollisionShape> shapes) {
  RobotDescription robot;
  robot.name = "crane";
  robot.joints = {{"turn", Joint::Type::kRevolute, -4.0, 4.0, 100.0, 1e3},
                  {"slide", Joint::Type::kPrismatic, 0.0, 3.0, 100.0, 1e3}};
  robot.links = {{"base", -1}, {"arm", 0}, {"tip", 1}};
  robot.shapes = std::move(shapes);
  robot.spheres = {{2, Eigen::Vector3d::Zero(), 0.05}};
  std::vector<TreeJoint> joints{
      {"root"}, {"turn", TreeJoint::Motion::kRotation}, {"slide", TreeJoint::Motion::kTranslation}};
  joints[1].joint = 0;
  joints[2].joint = 1;
  joints[2].axis = Eigen::Vector3d::UnitX();
  auto tree = KinematicTree::create(std::move(robot), std::move(joints));
  if (!tree) throw std::runtime_error(tree.error().describe());
  return std::move(*tree);
}

/// With a ball at its end.
inline std::shared_ptr<const KinematicTree> crane(double ball_m) {
  return crane_of({{2, Sphere{ball_m}, Transform::Identity()}});
}

}  // namespace sidestep::testing_certify
