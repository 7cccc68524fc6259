#include "shape_motion.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing_support::mobile_arm;

TEST(BezierJoint, FindsTheExcessThatDenseSamplingFinds) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int exceeded = 0;
  for (int i = 0; i < 500; ++i) {
    Trajectory trajectory = make_trajectory(1, 2, 0.3 + std::abs(unit(random)));
    trajectory.positions = {unit(random), unit(random)};
    trajectory.velocities = {4.0 * unit(random), 4.0 * unit(random)};
    const double h_s = trajectory.duration_s();
    const auto joint = BezierJoint::between(trajectory.positions[0], trajectory.velocities[0],
                                            trajectory.positions[1], trajectory.velocities[1], h_s);
    const double from = 0.3 * std::abs(unit(random));
    double highest = -10.0;
    double fastest = 0.0;
    for (int k = 0; k <= 20000; ++k) {
      double q = 0.0;
      double v = 0.0;
      trajectory.sample(h_s * (from + (1.0 - from) * k / 20000.0), {&q, 1}, {&v, 1});
      highest = std::max(highest, q);
      fastest = std::max(fastest, std::abs(v));
    }
    const auto excess = BezierJoint::above(joint.position, 0.9, 1e-6, from, 1.0);
    EXPECT_NEAR(excess.amount, std::max(0.0, highest - 0.9), 2e-6);
    EXPECT_GE(joint.fastest(from, 1.0), fastest - 1e-9);
    EXPECT_NEAR(
        joint.fastest(0.5, 0.5 + 1e-7),
        [&] {
          double q = 0.0;
          double v = 0.0;
          trajectory.sample(0.5 * h_s, {&q, 1}, {&v, 1});
          return std::abs(v);
        }(),
        1e-4);
    if (excess.amount > 0.0) {
      ++exceeded;
      double q = 0.0;
      trajectory.sample(excess.u * h_s, {&q, 1}, {});
      EXPECT_NEAR(q - 0.9, excess.amount, 1e-9);
    }
  }
  EXPECT_GT(exceeded, 50);
}

TEST(BezierJoint, StopsAtACurveThatRestsOnItsLimit) {
  const auto joint = BezierJoint::between(1.0, 0.0, 1.0, 0.0, 1.0);
  EXPECT_EQ(BezierJoint::above(joint.position, 1.0, 0.0, 0.0, 1.0).amount, 0.0);
  EXPECT_NEAR(BezierJoint::above(joint.position, 0.9, 0.0, 0.0, 1.0).amount, 0.1, 1e-12);
}

TEST(FarthestPoint, IsTheFarthestOfManySampledPoints) {
  Transform pose = transform_from_xyz_rpy({0.1, -0.2, 0.3}, {0.4, 0.5, 0.6});
  EXPECT_NEAR(farthest_point_m({0, Sphere{0.2}, pose}), std::sqrt(0.14) + 0.2, 1e-12);
  EXPECT_NEAR(farthest_point_m({0, Box{{0.2, 0.4, 0.6}}, Transform::Identity()}), std::sqrt(0.14),
              1e-12);
  const Shape shapes[] = {Box{{0.2, 0.4, 0.6}}, Cylinder{0.15, 0.5}, Capsule{0.1, 0.4}};
  for (const Shape& shape : shapes) {
    const double bound = farthest_point_m({0, shape, pose});
    double farthest = 0.0;
    for (const Eigen::Vector3d& p : triangulate(shape).vertices_m) {
      farthest = std::max(farthest, (pose * p).norm());
    }
    EXPECT_GE(bound, farthest - 1e-9) << shape_name(shape);
    EXPECT_LT(bound, 1.2 * farthest) << shape_name(shape);
  }
}

/// Points fixed to links never move more than the bound, against the world and each other.
TEST(ShapeMotion, BoundsTheWayOfEveryPoint) {
  const auto robot = mobile_arm();
  RobotDescription& d = robot->description();
  for (const int link : {3, 5, 7}) {
    d.shapes.push_back({link, Box{{0.1, 0.2, 0.3}}, Transform(Eigen::Translation3d(0, 0, 0.1))});
  }
  const ShapeMotion motion(*robot);
  std::mt19937 random(2);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Scratch scratch;
  constexpr double kLimit_m = 0.08;
  double tightest = 0.0;
  for (int i = 0; i < 300; ++i) {
    std::vector<double> from(7);
    std::vector<double> ways(7);
    for (std::size_t j = 0; j < 7; ++j) {
      from[j] = unit(random);
      ways[j] = 0.01 * std::abs(unit(random));
    }
    std::vector<Transform> before(d.links.size());
    std::vector<Transform> after(d.links.size());
    robot->link_poses(from, before, scratch);
    std::vector<double> to = from;
    for (std::size_t j = 0; j < 7; ++j) to[j] += unit(random) > 0.0 ? ways[j] : -ways[j];
    robot->link_poses(to, after, scratch);
    for (const int link : {3, 5, 7}) {
      const double bound = motion.link_way_m(link, before, ways, kLimit_m);
      ASSERT_LE(bound, kLimit_m);
      const double relative = motion.link_way_m(link, before, ways, kLimit_m, 4);
      const auto l = static_cast<std::size_t>(link);
      for (int c = 0; c < 8; ++c) {
        const Eigen::Vector3d corner((c & 1) != 0 ? 0.05 : -0.05, (c & 2) != 0 ? 0.1 : -0.1,
                                     (c & 4) != 0 ? 0.25 : -0.05);
        const double moved = (before[l] * corner - after[l] * corner).norm();
        ASSERT_LE(moved, bound + 1e-12);
        tightest = std::max(tightest, moved / bound);
        if (link == 3) continue;
        const double against_mast =
            (before[4].inverse() * before[l] * corner - after[4].inverse() * after[l] * corner)
                .norm();
        ASSERT_LE(against_mast, relative + 1e-12);
      }
    }
    EXPECT_EQ(motion.link_way_m(3, before, ways, kLimit_m, 7), 0.0);  // carries link 7
  }
  EXPECT_GT(tightest, 0.6);
}

}  // namespace
}  // namespace sidestep
