#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/robot/robot_model.hpp>

/// What every RobotModel must hold, for the test of a robot plugin:
///
///     TEST(MyRobot, Conforms) { sidestep::conformance::check_robot(*load_my_robot()); }
namespace sidestep::conformance {

/// `n` configurations within the limits, uniform; unbounded joints within +-pi.
inline std::vector<double> random_configurations(const RobotDescription& robot, int n,
                                                 std::uint64_t seed) {
  std::mt19937_64 generator(seed);
  std::vector<double> q;
  for (int i = 0; i < n; ++i) {
    for (const Joint& joint : robot.joints) {
      const double lower = std::isfinite(joint.lower) ? joint.lower : -M_PI;
      const double upper = std::isfinite(joint.upper) ? joint.upper : M_PI;
      q.push_back(std::uniform_real_distribution<double>(lower, upper)(generator));
    }
  }
  return q;
}

/// Names, parents, limits and sizes that every user of a description relies on.
inline void check_description(const RobotDescription& robot) {
  EXPECT_FALSE(robot.name.empty());
  ASSERT_FALSE(robot.joints.empty());
  ASSERT_FALSE(robot.links.empty());
  ASSERT_FALSE(robot.spheres.empty());
  for (const Joint& joint : robot.joints) {
    SCOPED_TRACE(joint.name);
    EXPECT_EQ(&robot.joints[static_cast<std::size_t>(*robot.joint_index(joint.name))], &joint);
    EXPECT_LE(joint.lower, joint.upper);
    EXPECT_GT(joint.max_velocity, 0.0);
    EXPECT_GT(joint.max_acceleration, 0.0);
    if (joint.type != Joint::Type::kContinuous) {
      EXPECT_TRUE(std::isfinite(joint.lower) && std::isfinite(joint.upper));
    }
  }
  const int links = static_cast<int>(robot.links.size());
  EXPECT_EQ(robot.links.front().parent, -1);
  for (int i = 1; i < links; ++i) {
    const Link& link = robot.links[static_cast<std::size_t>(i)];
    EXPECT_TRUE(link.parent >= 0 && link.parent < i) << link.name;
    EXPECT_EQ(robot.link_index(link.name), i);
  }
  for (const CollisionSphere& sphere : robot.spheres) {
    EXPECT_TRUE(sphere.link >= 0 && sphere.link < links);
    EXPECT_GT(sphere.radius_m, 0.0);
  }
  for (const auto& [a, b] : robot.self_collision_pairs) {
    EXPECT_TRUE(0 <= a && a < b && b < links);
  }
  for (const NamedPose& pose : robot.poses) {
    SCOPED_TRACE(pose.name);
    EXPECT_EQ(robot.find_pose(pose.name), &pose);
    ASSERT_EQ(pose.positions.size(), robot.joints.size());
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      if (!pose.positions[j]) continue;
      EXPECT_GE(*pose.positions[j], robot.joints[j].lower) << robot.joints[j].name;
      EXPECT_LE(*pose.positions[j], robot.joints[j].upper) << robot.joints[j].name;
    }
  }
}

/// A batch gives what its rows give one by one, and centres are where link_poses says.
inline void check_centres(const RobotModel& model, int n, std::uint64_t seed) {
  const RobotDescription& robot = model.description();
  const std::size_t dof = robot.joints.size();
  const std::size_t count = robot.spheres.size();
  const std::vector<double> q = random_configurations(robot, n, seed);
  std::vector<Eigen::Vector3d> batch(static_cast<std::size_t>(n) * count);
  Scratch scratch;
  model.sphere_centres(q, batch, scratch);
  std::vector<PointLanes> in_lanes(padded(static_cast<std::size_t>(n)) / kLanes * count);
  model.sphere_centre_lanes(q, in_lanes, scratch);
  std::vector<Transform> T_world_link(robot.links.size());
  for (std::size_t row = 0; row < static_cast<std::size_t>(n); ++row) {
    model.link_poses(std::span(q).subspan(row * dof, dof), T_world_link, scratch);
    for (std::size_t s = 0; s < count; ++s) {
      const CollisionSphere& sphere = robot.spheres[s];
      const Eigen::Vector3d expected =
          T_world_link[static_cast<std::size_t>(sphere.link)] * sphere.centre_link_m;
      EXPECT_LT((batch[row * count + s] - expected).norm(), 1e-12) << "sphere " << s;
      const PointLanes& lanes = in_lanes[row / kLanes * count + s];
      const Eigen::Vector3d in_lane(lanes.x[row % kLanes], lanes.y[row % kLanes],
                                    lanes.z[row % kLanes]);
      EXPECT_LT((in_lane - expected).norm(), 1e-12) << "sphere " << s;
    }
  }
}

/// Jacobians against central differences.
inline void check_derivatives(const RobotModel& model, int n, std::uint64_t seed) {
  const RobotDescription& robot = model.description();
  const std::size_t dof = robot.joints.size();
  const std::size_t count = robot.spheres.size();
  const std::size_t rows = static_cast<std::size_t>(n);
  const std::vector<double> q = random_configurations(robot, n, seed);
  std::vector<Eigen::Vector3d> centres(rows * count), ahead(count), behind(count);
  std::vector<Eigen::Vector3d> jacobians(rows * count * dof, Eigen::Vector3d::Constant(NAN));
  Scratch scratch;
  model.sphere_jacobians(q, centres, jacobians, scratch);

  std::vector<Eigen::Vector3d> plain(rows * count);
  model.sphere_centres(q, plain, scratch);
  for (std::size_t i = 0; i < plain.size(); ++i) EXPECT_LT((plain[i] - centres[i]).norm(), 1e-12);

  constexpr double kStep = 1e-6;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t j = 0; j < dof; ++j) {
      std::vector<double> moved(q.begin() + static_cast<std::ptrdiff_t>(row * dof),
                                q.begin() + static_cast<std::ptrdiff_t>((row + 1) * dof));
      moved[j] += kStep;
      model.sphere_centres(moved, ahead, scratch);
      moved[j] -= 2.0 * kStep;
      model.sphere_centres(moved, behind, scratch);
      for (std::size_t s = 0; s < count; ++s) {
        const Eigen::Vector3d difference = (ahead[s] - behind[s]) / (2.0 * kStep);
        EXPECT_LT((jacobians[(row * count + s) * dof + j] - difference).norm(), 1e-7)
            << "sphere " << s << ", joint " << robot.joints[j].name;
      }
    }
  }
}

/// pull_back against sphere_jacobians, for forces at spheres, and against how link_poses turns
/// links by central differences, for moments. Rows and links at random, some left out, some
/// repeated.
inline void check_pull_back(const RobotModel& model, int n, std::uint64_t seed) {
  const RobotDescription& robot = model.description();
  const std::size_t dof = robot.joints.size();
  const std::size_t count = robot.spheres.size();
  const std::size_t rows = static_cast<std::size_t>(n);
  const std::vector<double> q = random_configurations(robot, n, seed);
  std::vector<Eigen::Vector3d> centres(rows * count), jacobians(rows * count * dof);
  Scratch scratch;
  model.sphere_jacobians(q, centres, jacobians, scratch);

  std::mt19937_64 generator(seed + 1);
  std::normal_distribution<double> normal;
  const auto any_vector = [&] {
    return Eigen::Vector3d(normal(generator), normal(generator), normal(generator));
  };
  std::vector<LinkForce> forces;
  std::vector<std::size_t> sphere_of;  // count: none, a moment only
  for (std::size_t row = generator() % 2; row < rows; row += 1 + generator() % 2) {
    for (std::size_t s = generator() % 3; s < count; s += 1 + generator() % 3) {
      const Eigen::Vector3d force = any_vector();
      forces.push_back({static_cast<int>(row), robot.spheres[s].link, force,
                        centres[row * count + s].cross(force)});
      sphere_of.push_back(s);
    }
    const int link = static_cast<int>(generator() % robot.links.size());
    forces.push_back({static_cast<int>(row), link, Eigen::Vector3d::Zero(), any_vector()});
    sphere_of.push_back(count);
  }
  std::vector<double> pulled(forces.size() * dof, NAN);
  model.pull_back(q, forces, pulled, scratch);

  constexpr double kStep = 1e-6;
  std::vector<Transform> ahead(robot.links.size()), behind(robot.links.size());
  for (std::size_t k = 0; k < forces.size(); ++k) {
    const std::size_t row = static_cast<std::size_t>(forces[k].row);
    const auto link = static_cast<std::size_t>(forces[k].link);
    for (std::size_t j = 0; j < dof; ++j) {
      double expected = 0.0;
      if (sphere_of[k] < count) {
        expected = jacobians[(row * count + sphere_of[k]) * dof + j].dot(forces[k].force);
      } else {
        std::vector<double> moved(q.begin() + static_cast<std::ptrdiff_t>(row * dof),
                                  q.begin() + static_cast<std::ptrdiff_t>((row + 1) * dof));
        moved[j] += kStep;
        model.link_poses(moved, ahead, scratch);
        moved[j] -= 2.0 * kStep;
        model.link_poses(moved, behind, scratch);
        const Eigen::AngleAxisd turn(ahead[link].linear() * behind[link].linear().transpose());
        expected = turn.angle() / (2.0 * kStep) * turn.axis().dot(forces[k].moment);
      }
      const double tolerance = sphere_of[k] < count ? 1e-10 : 1e-5;
      EXPECT_NEAR(pulled[k * dof + j], expected, tolerance * (1.0 + std::abs(expected)))
          << "link " << robot.links[link].name << ", joint " << robot.joints[j].name;
    }
  }
}

/// A KinematicTree places spheres in single precision, and pulls back along the axes that it
/// leaves, as it does in double precision but for rounding.
inline void check_pull_back_along(const KinematicTree& tree, int n, std::uint64_t seed) {
  constexpr double kRounding = 3e-6;  // of lengths of a metre, through a chain of joints
  const RobotDescription& robot = tree.description();
  const auto rows = static_cast<std::size_t>(n);
  const std::vector<double> q = random_configurations(robot, n, seed);
  Scratch scratch;
  Scratch::Scope scope(scratch);
  const std::size_t spheres = robot.spheres.size();
  const auto centres = scope.array<Eigen::Vector3d>(rows * spheres);
  const auto in_floats = scope.array<PointFloats>(float_groups(rows) * spheres);
  const auto axes = scope.array<float>(tree.axes_size(rows));
  tree.sphere_centres(q, centres, scratch);
  tree.sphere_centre_lanes(q, in_floats, axes, scratch);
  std::vector<LinkForce> forces;
  std::vector<double> levers_m;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t s = 0; s < spheres; ++s) {
      const PointFloats& in = in_floats[row / kFloatLanes * spheres + s];
      const std::size_t lane = row % kFloatLanes;
      const Eigen::Vector3d& centre = centres[row * spheres + s];
      const Eigen::Vector3f in_lane(in.x[lane], in.y[lane], in.z[lane]);
      EXPECT_LT((in_lane.cast<double>() - centre).norm(), kRounding * (1.0 + centre.norm()));
      const Eigen::Vector3d force(1.0, -2.0, 0.5);
      if ((row + s) % 3 == 0) continue;
      forces.push_back({static_cast<int>(row), robot.spheres[s].link, force, centre.cross(force)});
      levers_m.push_back(1.0 + centre.norm());
    }
  }
  const std::size_t dof = robot.joints.size();
  // With room for whole lanes after the last row, and without.
  for (const std::size_t room : {std::size_t{0}, kLanes}) {
    std::vector<double> pulled(forces.size() * dof, NAN), along(pulled.size() + room, NAN);
    tree.pull_back(q, forces, pulled, scratch);
    tree.pull_back_along(axes, forces, along, scratch);
    for (std::size_t i = 0; i < pulled.size(); ++i) {
      EXPECT_NEAR(along[i], pulled[i], kRounding * 3.0 * levers_m[i / dof]);
    }
  }
}

/// Several threads with a Scratch each get the same as one.
inline void check_threads(const RobotModel& model, std::uint64_t seed) {
  const RobotDescription& robot = model.description();
  const std::vector<double> q = random_configurations(robot, 64, seed);
  std::vector<std::vector<Eigen::Vector3d>> results(4);
  {
    std::vector<std::jthread> threads;
    for (auto& result : results) {
      result.resize(64 * robot.spheres.size());
      threads.emplace_back([&] {
        Scratch scratch;
        for (int i = 0; i < 10; ++i) model.sphere_centres(q, result, scratch);
      });
    }
  }
  for (const auto& result : results) EXPECT_EQ(result, results.front());
}

/// All of the above.
inline void check_robot(const RobotModel& model, int configurations = 20, std::uint64_t seed = 1) {
  check_description(model.description());
  if (::testing::Test::HasFatalFailure()) return;
  check_centres(model, configurations, seed);
  check_derivatives(model, configurations, seed);
  check_pull_back(model, configurations, seed);
  if (const auto* tree = dynamic_cast<const KinematicTree*>(&model)) {
    check_pull_back_along(*tree, 13, seed);
  }
  check_threads(model, seed);
}

}  // namespace sidestep::conformance
