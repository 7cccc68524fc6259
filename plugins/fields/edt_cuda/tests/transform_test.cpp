#include "transform.hpp"

#include <gtest/gtest.h>

#include <tuple>

#include "transform_checks.hpp"
#include "transform_on.hpp"

namespace sidestep::edt_cuda {
namespace {

using checks::Case;
using cuda::HostBackend;
using cuda::Order;

MakeTransform on_host(Order order = Order::kForward) {
  return [order](const TransformSettings& settings) {
    return make_host_transform(settings, HostBackend(order));
  };
}

class HostTransform : public testing::TestWithParam<std::tuple<Order, Case>> {};

TEST_P(HostTransform, EqualsASearchThroughChanges) {
  const auto& [order, c] = GetParam();
  EXPECT_EQ(checks::check_sequence(on_host(order), c), "");
}

std::string name_of(const testing::TestParamInfo<std::tuple<Order, Case>>& tested) {
  constexpr const char* kOrders[] = {"forward", "backward", "shuffled"};
  const auto& [order, c] = tested.param;
  return c.name + "_" + kOrders[static_cast<int>(order)];
}

INSTANTIATE_TEST_SUITE_P(Small, HostTransform,
                         testing::Combine(testing::Values(Order::kForward, Order::kBackward,
                                                          Order::kShuffled),
                                          testing::ValuesIn(checks::small_cases())),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Large, HostTransform,
                         testing::Combine(testing::Values(Order::kForward),
                                          testing::ValuesIn(checks::large_cases())),
                         name_of);

TEST(HostTransformSizes, TooLongAnAxisIsAnError) {
  const auto made = on_host()({{1 << 16, 1, 1}, 1024, false});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
}

TEST(HostTransformSizes, TooFarADistanceIsAnError) {
  const auto made = on_host()({{30000, 30000, 1}, 1'800'000'000u, false});
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(made.error().hint.find("max_distance_m"), std::string::npos);
}

TEST(HostTransformSizes, MoreThanTheMemoryIsAnError) {
  const auto made = make_host_transform({{320, 320, 128}, 1024, false},
                                        HostBackend(Order::kForward, std::size_t{64} << 20));
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnsupported);
}

/// What a change of one voxel asks for is far less than everything.
TEST(DirtyRegion, FollowsTheReach) {
  const Shape shape{{320, 320, 128}, {20, 20, 8}, 320};
  DirtyRegion region(shape, 31);
  const std::int32_t middle = shape.block(10, 10, 4);
  const DirtyLines& one = region.of({&middle, 1});
  EXPECT_EQ(one.rows, (std::vector<std::int32_t>{10 + 20 * 4}));
  // Voxels 129 to 206 along x and y: 3 tiles, 2 segments of 64 along y, 5 slabs of 16; 33 to 110
  // along z: 2 segments.
  EXPECT_EQ(one.along_y.size(), 3u * 2u);
  EXPECT_EQ(one.along_z.size(), 3u * 2u * 5u);
  EXPECT_EQ(region.of({}).along_z.size(), 0u);
  EXPECT_EQ(region.everything().along_z.size(), 10u * 2u * 20u);
  DirtyRegion unlimited(shape, 470);
  EXPECT_EQ(unlimited.of({&middle, 1}).along_z.size(), 10u * 2u * 20u);
}

}  // namespace
}  // namespace sidestep::edt_cuda
