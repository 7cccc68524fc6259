#include "eye_contact.hpp"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include <sidestep/conformance/gaze_conformance.hpp>
#include <sidestep/conformance/test_host.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

Track somebody(double x_m, double y_m, double top_m) {
  Track track;
  track.position_m = {x_m, y_m};
  track.top_m = top_m;
  return track;
}

/// A robot at the origin, whose camera is 1 m above it.
HeadAngles look_at(const Tracks& tracks) {
  Looker looker;
  looker.now = Stamp::from_seconds(2.0);
  looker.tracks = tracks;
  TestHost host;
  const auto gaze = *eye_contact::create({.within_m = 4.0, .below_top_m = 0.1}, host.context());
  EXPECT_TRUE(gaze->wants_tracks());
  return *gaze->look(looker.request());
}

TEST(EyeContact, LooksTheNearestInTheEye) {
  const HeadAngles to = look_at({{somebody(2.0, -2.5, 1.8), somebody(2.0, 2.0, 1.9)}, {}});
  EXPECT_NEAR(to.pan_rad, std::numbers::pi / 4.0, 1e-9);
  EXPECT_NEAR(to.tilt_rad, std::atan(0.8 / std::hypot(2.0, 2.0)), 1e-9);
}

TEST(EyeContact, GoesByWhereTheyAreNow) {
  Track walker = somebody(0.0, 2.0, 1.1);
  walker.velocity_mps = {2.0, 0.0};
  // Seen a second ago, beside the robot; at 45 degrees by now, with eyes as high as the camera.
  const HeadAngles to = look_at({{walker}, Stamp::from_seconds(1.0)});
  EXPECT_NEAR(to.pan_rad, std::numbers::pi / 4.0, 1e-9);
  EXPECT_NEAR(to.tilt_rad, 0.0, 1e-9);
}

TEST(EyeContact, RestsWhereNobodyIsNear) {
  const HeadAngles to = look_at({{somebody(0.0, 5.0, 1.8)}, {}});
  EXPECT_EQ(to.pan_rad, 0.0);
  EXPECT_EQ(to.tilt_rad, 0.0);
}

}  // namespace
