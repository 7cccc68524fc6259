#include <random>

#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>

#include "field_check_testing.hpp"
#include "support/chain_robot.hpp"
#include "support/limit_checks.hpp"
#include "support/voxel_field.hpp"

namespace sidestep {
namespace {

using testing_support::Aabb;
using testing_support::flying_ball;
using testing_support::rest_to_rest;

/// Motions whose looks, both ends and the middle, are as they should be, and which are not between:
/// a map without obstacles, so that no distance calls for further looks.
class BetweenLooksTest : public FieldCheckTest {
 protected:
  BetweenLooksTest() {
    world_.occupied.clear();
    settings_.max_step_m = 10.0;
    robot_ = flying_ball(0.01);
    for (Joint& joint : robot_->description().joints) joint.max_velocity = 100.0;
  }

  /// Out and back within `duration_s`: in the middle as far as a quarter of its product with
  /// `velocity`.
  [[nodiscard]] static Trajectory out_and_back(const Eigen::Vector3d& from,
                                               const Eigen::Vector3d& velocity, double duration_s) {
    Trajectory trajectory = rest_to_rest(from, from, duration_s);
    for (int j = 0; j < 3; ++j) {
      trajectory.qdot(0)[static_cast<std::size_t>(j)] = velocity[j];
      trajectory.qdot(1)[static_cast<std::size_t>(j)] = -velocity[j];
    }
    return trajectory;
  }
};

TEST_F(BetweenLooksTest, TheMapIsNotLeft) {
  space_.unknown = Space::kFree;
  // In the middle 0.075 m beyond where it begins and ends, 0.1 m or 0.05 m within the map.
  const auto outcome = [&](double within_m) {
    return check(out_and_back({2.0 - within_m, 1.0, 0.0}, {1.0, 0.0, 0.0}, 0.3)).outcome;
  };
  EXPECT_EQ(outcome(0.1), Verdict::Outcome::kValid);
  EXPECT_EQ(outcome(0.05), Verdict::Outcome::kInvalid);
}

TEST_F(BetweenLooksTest, NoVoxelIsUnseen) {
  std::mt19937 random(5);
  std::uniform_int_distribution<int> along(4, 36), across(10, 30);
  for (int i = 0; i < 50; ++i) {
    // One voxel anywhere on a straight way of 3.8 m along x, in the row of voxels of its y and z.
    const Eigen::Vector3d voxel_m(-2.0 + 0.1 * along(random), -2.0 + 0.1 * across(random), 0.0);
    world_.unknown = {Aabb{voxel_m, voxel_m + Eigen::Vector3d::Constant(0.1)}};
    const double y = voxel_m.y() + 0.05;
    const auto outcome = [&](double z) {
      return check(rest_to_rest(Eigen::Vector3d(-1.9, y, z), Eigen::Vector3d(1.9, y, z), 4.0))
          .outcome;
    };
    ASSERT_EQ(outcome(0.05), Verdict::Outcome::kInvalid) << voxel_m.transpose();
    ASSERT_EQ(outcome(0.15), Verdict::Outcome::kValid) << voxel_m.transpose();
  }
}

}  // namespace
}  // namespace sidestep
