#include "turns_back.hpp"

#include <gtest/gtest.h>

#include <sidestep/conformance/predictor_conformance.hpp>

namespace sidestep::conformance {
namespace {

TEST(TurnsBack, IsOnBothSides) {
  turns_back::TurnsBack predictor({.probability = 0.3, .widening_mps = 0.1});
  const Tracks walker{{track_at(5, {1.0, 0.0}, {0.8, 0.0})}, kTracked};
  const auto prediction = predictor.predict({walker, 5.0});
  ASSERT_TRUE(prediction) << prediction.error().describe();
  ASSERT_EQ(prediction->sets().size(), 2u);
  EXPECT_EQ(prediction->sets()[1].likelihood, 0.3);
  // After 2 s its radius is 0.3 m + 0.2 m, about x = 2.6 m or x = -0.6 m.
  const Eigen::Vector3d points_m[] = {{2.6, 1.0, 1.0}, {-0.6, 1.0, 1.0}, {1.0, 0.0, 1.0}};
  double distances_m[3];
  prediction->query(2.0, points_m, distances_m, {});
  EXPECT_NEAR(distances_m[0], 0.5, 1e-12);
  EXPECT_NEAR(distances_m[1], 0.5, 1e-12);
  EXPECT_NEAR(distances_m[2], 1.6 - 0.5, 1e-12);
}

}  // namespace
}  // namespace sidestep::conformance
