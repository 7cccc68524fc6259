#include "planar_match.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <sidestep/conformance/localiser_conformance.hpp>
#include <sidestep/conformance/test_host.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

std::unique_ptr<Localiser> localiser(const planar_match::Options& options) {
  TestHost host(1, {.robot = turning_robot()});
  return std::move(*planar_match::create(options, host.context()));
}

/// A frame without a point, from a sensor that has gone along x.
Frame nothing_from(double x_m) {
  Frame frame;
  frame.T_world_camera = Transform(Eigen::Translation3d(x_m, 0.0, 1.0)) * T_forward_optical();
  frame.measurement = PointCloud{};
  return frame;
}

TEST(PlanarMatch, KnowsNoMoreThanOdometryWhereItSeesNothing) {
  const auto blind = localiser({.drift_share = 0.03, .drift_rad_per_m = 0.0, .lost_m = 0.1});
  ASSERT_TRUE(blind->localise(nothing_from(0.0), nullptr));
  const BoxField nothing({});
  Localisation found;
  for (int i = 1; i <= 40; ++i) found = *blind->localise(nothing_from(0.1 * i), &nothing);
  // A random walk: after 4 m twice as far off as after 1 m.
  EXPECT_NEAR(found.sigma_m, 0.06, 1e-9);
  EXPECT_EQ(found.lost, "");
  for (int i = 41; i <= 120; ++i) found = *blind->localise(nothing_from(0.1 * i), &nothing);
  EXPECT_NEAR(found.sigma_m, 0.03 * std::sqrt(12.0), 1e-9);
  EXPECT_NE(found.lost, "");
}

TEST(PlanarMatch, IsForRobotsThatMoveInThePlane) {
  TestHost host;
  const auto none = planar_match::create({}, host.context());
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kUnsupported);
}

}  // namespace
