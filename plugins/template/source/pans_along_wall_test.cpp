#include "pans_along_wall.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <sidestep/conformance/test_host.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

std::vector<Frame> frames_of(const pans_along_wall::Options& options) {
  TestHost host;
  const auto source = *pans_along_wall::create(options, host.context());
  std::vector<Frame> frames;
  for (auto frame = source->next(Deadline()); *frame; frame = source->next(Deadline())) {
    frames.push_back(**frame);
  }
  return frames;
}

TEST(PansAlongWall, GoesAlongTheWall) {
  const auto frames = frames_of({.frames = 11, .rate_hz = 5.0, .speed_mps = 0.3});
  ASSERT_EQ(frames.size(), 11U);
  EXPECT_EQ(frames.back().stamp, Stamp::from_seconds(2.0));
  EXPECT_NEAR(frames.back().T_world_camera.translation().y(), 0.6, 1e-12);
}

TEST(PansAlongWall, MeasuresDepthAlongTheOpticalAxis) {
  // After a second it is turned by 0.5 sin(1) rad.
  const auto frames = frames_of({.frames = 2, .rate_hz = 1.0, .distance_m = 2.0, .pan_rad = 0.5});
  for (const float depth_m : std::get<DepthImage>(frames[0].measurement).depth_m) {
    ASSERT_EQ(depth_m, 2.0F);  // straight ahead: one depth for all pixels
  }
  const auto& turned = std::get<DepthImage>(frames[1].measurement);
  const double pan_rad = 0.5 * std::sin(1.0);
  for (const int u : {0, 80, 159}) {
    // Left of the axis, where u is less, by the angle a: 2 m / cos(pan + a) away, times cos(a).
    const double a = std::atan((79.5 - u) / 138.6);
    EXPECT_NEAR(static_cast<double>(turned.at(u, 60)), 2.0 * std::cos(a) / std::cos(pan_rad + a),
                1e-5);
  }
}

TEST(PansAlongWall, GetsNothingBackFromFarAway) {
  const auto frames = frames_of({.frames = 1, .distance_m = 2.0, .max_range_m = 2.1});
  const auto& image = std::get<DepthImage>(frames[0].measurement);
  EXPECT_EQ(image.at(80, 60), 2.0F);
  EXPECT_EQ(image.at(0, 0), 0.0F);  // 2.5 m along its ray
}

}  // namespace
