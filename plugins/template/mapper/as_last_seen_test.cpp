#include "as_last_seen.hpp"

#include <gtest/gtest.h>

#include <sidestep/conformance/test_host.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

/// One point ahead of a sensor that is in voxel (2, 10, 10) and looks along x.
Frame frame_of(double ahead_m) {
  Frame frame;
  frame.T_world_camera = Transform(Eigen::Translation3d(0.25, 1.05, 1.05)) * T_forward_optical();
  frame.measurement = PointCloud{{Eigen::Vector3d(0.0, 0.0, ahead_m).cast<float>()}};
  return frame;
}

TEST(AsLastSeen, BelievesTheNewestFrameAlone) {
  TestHost host;
  as_last_seen::Options options;
  options.resolution_m = 0.1;
  options.size_vox = {40, 20, 20};
  options.origin_m = {0.0, 0.0, 0.0};
  const auto mapper = *as_last_seen::create(options, host.context());
  const auto& map = dynamic_cast<const OccupancyView&>(*mapper);
  const auto occupied = [&](int x) { return map.occupied().at(map.occupancy_grid(), {x, 10, 10}); };
  const auto known = [&](int x) { return map.known().at(map.occupancy_grid(), {x, 10, 10}); };

  ASSERT_TRUE(mapper->integrate(frame_of(1.0)));  // at x = 1.25 m
  EXPECT_TRUE(occupied(12));
  EXPECT_FALSE(occupied(11));
  EXPECT_TRUE(known(11));
  EXPECT_FALSE(known(13));

  ASSERT_TRUE(mapper->integrate(frame_of(2.0)));  // once is enough
  EXPECT_FALSE(occupied(12));
  EXPECT_TRUE(occupied(22));

  ASSERT_TRUE(mapper->integrate(frame_of(0.5)));  // what is behind stays as it was
  EXPECT_TRUE(occupied(7));
  EXPECT_TRUE(occupied(22));
}

}  // namespace
