#pragma once

#include <memory>

#include <gtest/gtest.h>

#include <sidestep/planning/validity_check.hpp>

#include "support/chain_robot.hpp"
#include "support/limit_checks.hpp"
#include "support/voxel_field.hpp"

namespace sidestep {

inline const SpacePolicy kOccupied{Space::kOccupied, Space::kOccupied};

/// A wall across x = 0 whose voxels' centres lie at x = +-0.05, for y < 0.5.
inline testing_support::VoxelWorld half_wall() {
  testing_support::VoxelWorld world;
  world.grid = {{-2.0, -2.0, -1.0}, 0.1, {40, 40, 20}};
  world.occupied = {testing_support::Aabb{{-0.1, -2.0, -1.0}, {0.1, 0.5, 1.0}}};
  return world;
}

class FieldCheckTest : public testing::Test {
 protected:
  std::shared_ptr<testing_support::ChainRobot> robot_ = testing_support::flying_ball(0.1);
  testing_support::VoxelWorld world_ = half_wall();
  SpacePolicy space_ = kOccupied;
  FieldCheckSettings settings_;

  [[nodiscard]] Result<Verdict> try_check(const Trajectory& trajectory, double from_s = 0.0,
                                          const Deadline& deadline = Deadline()) const {
    return make_field_check(robot_, world_.field(), space_, settings_)
        ->check(trajectory, from_s, deadline);
  }
  [[nodiscard]] Verdict check(const Trajectory& trajectory, double from_s = 0.0) const {
    auto verdict = try_check(trajectory, from_s);
    EXPECT_TRUE(verdict) << verdict.error().describe();
    return verdict.value();
  }
  [[nodiscard]] testing_support::CheckOfLimits limits() {
    return {robot_->description(), settings_.speed_fraction, settings_.acceleration_fraction, true,
            [this](const Trajectory& trajectory) { return check(trajectory); }};
  }
};

}  // namespace sidestep
