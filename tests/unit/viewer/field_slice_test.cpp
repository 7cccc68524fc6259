#include "view_messages.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "view_testing.hpp"

namespace sidestep {
namespace {

using testing_support::DecodedMessage;
using testing_support::small_field_info;

/// Known in the lower half along x alone.
std::shared_ptr<const DenseField> half_known_field() {
  const auto whole = testing_support::ball_field({0.5, 1.2, 1.1});
  auto left = std::make_shared<KnownBlock>();
  left->rows.fill(0xffff);
  const auto none = std::make_shared<const KnownBlock>();
  DenseField::KnownBlocks known(whole->known_blocks().size());
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (i % 3 == 0) {
      known.set(i, left);
    } else {
      known.set(i, none);
    }
  }
  return std::make_shared<const DenseField>(whole->info(), whole->blocks(), known);
}

class EveryAxis : public ::testing::TestWithParam<int> {};

TEST_P(EveryAxis, HoldsTheDistancesOfAVoxelsLayer) {
  const auto field = half_known_field();
  const GridSpec& grid = field->info().grid;
  const int axis = GetParam();
  const int layer = 7;
  const double position_m = grid.centre_m(Eigen::Vector3i::Constant(layer))[axis];
  const FieldSlice slice = make_slice(*field, {axis, position_m});
  const DecodedMessage message(
      *slice_message(Stamp::from_seconds(2.0), Stamp::from_seconds(1.5), slice).bytes);
  const int across = axis == 0 ? 1 : 0, down = axis == 2 ? 1 : 2;
  EXPECT_EQ(message.kind(), "slice");
  EXPECT_EQ(message.header.at("axis"), std::string(1, "xyz"[axis]));
  EXPECT_EQ(message.header.at("columns"), grid.size_vox[across]);
  EXPECT_EQ(message.header.at("rows"), grid.size_vox[down]);
  EXPECT_EQ(message.header.at("stamp_s"), 1.5);
  EXPECT_EQ(message.header.at("max_m"), 0.5);
  ASSERT_EQ(message.payload.size(),
            2U * static_cast<std::size_t>(grid.size_vox[across] * grid.size_vox[down]));
  const double step_m = message.header.at("step_m");
  std::size_t i = 0;
  int unknown = 0;
  for (int row = 0; row < grid.size_vox[down]; ++row) {
    for (int column = 0; column < grid.size_vox[across]; ++column, ++i) {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k)
        p[k] = message.header.at("first_m").at(static_cast<std::size_t>(k));
      p[across] += column * step_m;
      p[down] += row * step_m;
      const Eigen::Vector3i voxel = grid.voxel_at(p);
      ASSERT_EQ(voxel[axis], layer);
      if (!field->known(voxel)) {
        ASSERT_EQ(message.i16(i), -32768);
        ++unknown;
      } else {
        ASSERT_NEAR(message.i16(i), 1e3 * field->at(voxel), 0.51);
      }
    }
  }
  EXPECT_EQ(unknown == 0, axis == 0) << "layer 7 of x is known, the others half";
}
INSTANTIATE_TEST_SUITE_P(FieldSlice, EveryAxis, ::testing::Values(0, 1, 2));

TEST(FieldSlice, StaysInTheGrid) {
  const auto field = testing_support::ball_field({0.5, 1.2, 1.1});
  const GridSpec& grid = field->info().grid;
  const Eigen::Vector3d first = grid.centre_m(Eigen::Vector3i::Zero());
  const Eigen::Vector3d last = grid.centre_m(grid.size_vox - Eigen::Vector3i::Ones());
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(make_slice(*field, {axis, -1e9}).request.position_m, first[axis], 1e-9);
    EXPECT_NEAR(make_slice(*field, {axis, 1e9}).request.position_m, last[axis], 1e-9);
  }
}

TEST(FieldSlice, OfATimeAheadHasWhatIsPredictedForThen) {
  const auto field = half_known_field();
  // From (-0.5, 1.4) at 1 m/s along x.
  PredictedSet set;
  set.track = 1;
  set.top_m = 2.0;
  set.knots = {{0.0, {-0.5, 1.4}, 0.3}, {4.0, {3.5, 1.4}, 0.3}};
  const auto prediction = Prediction::create(Stamp::from_seconds(1.0), {set});
  ASSERT_TRUE(prediction);
  const SliceRequest request{2, 1.0, 1.25};
  const FieldSlice alone = make_slice(*field, {2, 1.0});
  const FieldSlice slice = make_slice(*field, request, &*prediction, Stamp::from_seconds(1.5));
  ASSERT_EQ(slice.distance_mm.size(), alone.distance_mm.size());
  for (int row = 0; row < slice.rows; ++row) {
    for (int column = 0; column < slice.columns; ++column) {
      const auto i = static_cast<std::size_t>(row * slice.columns + column);
      const double x_m = slice.first_m.x() + column * slice.step_m;
      const double y_m = slice.first_m.y() + row * slice.step_m;
      const double to_axis_m = std::hypot(x_m - 1.25, y_m - 1.4);  // 1.75 s after its stamp
      const bool is_unseen = alone.distance_mm[i] == FieldSlice::kUnknown;
      if (to_axis_m > 0.3 && is_unseen) {
        ASSERT_EQ(slice.distance_mm[i], FieldSlice::kUnknown);
      } else if (to_axis_m <= 0.3) {
        ASSERT_LE(slice.distance_mm[i], 0);
      } else {
        ASSERT_NEAR(slice.distance_mm[i],
                    std::min(1e3 * (to_axis_m - 0.3), 1.0 * alone.distance_mm[i]), 1.01);
      }
    }
  }
  EXPECT_EQ(DecodedMessage(*slice_message({}, {}, slice).bytes).header.at("ahead_s"), 1.25);
  EXPECT_FALSE(make_slice(*field, request).request.ahead_s) << "nothing is predicted";
}

TEST(FieldSlice, LargeGridsAreSampledAtEveryNthVoxel) {
  FieldInfo info = small_field_info();
  info.grid.size_vox = {600, 20, 3};
  const auto field = testing_support::ball_field({0.5, 1.2, 0.4}, info);
  const FieldSlice slice = make_slice(*field, {2, 0.4});
  EXPECT_EQ(slice.columns, 200);
  EXPECT_EQ(slice.rows, 7);
  EXPECT_NEAR(slice.step_m, 0.3, 1e-12);
  const auto at = static_cast<std::size_t>(3 * slice.columns + 5);
  EXPECT_NEAR(slice.distance_mm[at], 1e3 * field->at({15, 9, 1}), 0.51);
}

TEST(FieldSlice, FieldsWithoutALimitHaveThatOfTheirNumbers) {
  FieldInfo info = small_field_info();
  info.max_distance_m = std::numeric_limits<double>::infinity();
  const auto field = make_dense_field(
      info, [](const Eigen::Vector3i& voxel) { return voxel.x() == 0 ? -40.0 : 40.0; });
  const FieldSlice slice = make_slice(*field, {2, 0.4});
  EXPECT_EQ(slice.max_distance_m, 32.767);
  EXPECT_EQ(slice.distance_mm[0], -32767);
  EXPECT_EQ(slice.distance_mm[1], 32767);
}

}  // namespace
}  // namespace sidestep
