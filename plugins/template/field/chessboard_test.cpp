#include <algorithm>
#include <cmath>
#include <memory>

#include <gtest/gtest.h>

#include <sidestep/conformance/grid_map.hpp>
#include <sidestep/conformance/test_host.hpp>
#include <sidestep/field/dense_field.hpp>

#include "chessboard.hpp"

namespace sidestep::conformance {
namespace {

constexpr double kMaxDistance_m = 0.4;

class Chessboard : public testing::TestWithParam<double> {};

TEST_P(Chessboard, IsTheLargestOfTheThreeDifferencesLessTheInflation) {
  TestHost host(2);
  GridMap map({Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(20, 18, 17)});
  const Eigen::Vector3i obstacle(4, 9, 13);
  map.set(obstacle, true);
  const auto builder = chessboard::create(
      {.max_distance_m = kMaxDistance_m, .inflation_m = GetParam()}, host.context());
  ASSERT_TRUE(builder);
  ASSERT_TRUE((*builder)->attach(map));
  const auto field = (*builder)->update(map.take_update());
  ASSERT_TRUE(field) << field.error().describe();
  const auto& dense = dynamic_cast<const DenseField&>(**field);
  Eigen::Vector3i voxel;
  for (voxel.z() = 0; voxel.z() < 17; ++voxel.z()) {
    for (voxel.y() = 0; voxel.y() < 18; ++voxel.y()) {
      for (voxel.x() = 0; voxel.x() < 20; ++voxel.x()) {
        const double truth_m = 0.05 * (voxel - obstacle).cwiseAbs().maxCoeff() - GetParam();
        ASSERT_NEAR(dense.at(voxel), std::clamp(truth_m, 0.0, kMaxDistance_m), 1e-6)
            << voxel.transpose();
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(inflations, Chessboard, testing::Values(0.0, 0.12));

TEST(ChessboardOptions, InflateByLessThanTheyReach) {
  EXPECT_TRUE(chessboard::Options{}.check().empty());
  const chessboard::Options wrong{.max_distance_m = 0.3, .inflation_m = 0.4};
  ASSERT_EQ(wrong.check().size(), 1U);
  EXPECT_EQ(wrong.check()[0].parameters.at(0), "inflation_m");
}

}  // namespace
}  // namespace sidestep::conformance
