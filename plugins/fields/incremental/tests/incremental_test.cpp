#include "incremental_field.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <sidestep/field/dense_field.hpp>

#include "conformance/field_conformance.hpp"
#include "edt_field.hpp"
#include "error_bound.hpp"
#include "support/restless_map.hpp"

namespace sidestep::conformance {
namespace {

using incremental::Options;
using testing_support::RestlessMap;
using testing_support::updated;

constexpr double kResolution_m = 0.05;

/// The suite's grids have a diagonal of 89 voxels; a signed distance has two errors.
double error_bound_m(const Options& options) {
  const double reach_vox =
      options.max_distance_m > 0.0 ? options.max_distance_m / kResolution_m : 89.0;
  return (options.is_signed ? 2.0 : 1.0) * kResolution_m *
         incremental::detour_vox(std::stoi(options.connectivity), reach_vox);
}

FieldCase incremental_case(std::string name, Options options) {
  FieldCase field;
  field.name = std::move(name);
  field.is_signed = options.is_signed;
  field.unknown_is_occupied = options.unknown == "occupied";
  if (options.max_distance_m > 0.0) field.max_distance_m = options.max_distance_m;
  field.max_error_m = error_bound_m(options);
  field.create = [options](WorkerPool& workers) {
    return incremental::make_incremental_builder(options, workers);
  };
  return field;
}

INSTANTIATE_TEST_SUITE_P(
    incremental, FieldConformance,
    testing::Values(incremental_case("unsigned", {false, 0.4, "free", "24"}),
                    incremental_case("signed", {true, 0.4, "free", "24"}),
                    incremental_case("between_voxels", {false, 0.33, "free", "26"}),
                    incremental_case("one_voxel", {true, 0.05, "free", "26"}),
                    incremental_case("unlimited", {false, 0.0, "free", "26"}),
                    incremental_case("signed_unlimited", {true, 0.0, "free", "24"}),
                    incremental_case("unknown_occupied", {true, 0.4, "occupied", "18"}),
                    incremental_case("faces", {false, 0.4, "free", "6"})),
    [](const testing::TestParamInfo<FieldCase>& tested) { return tested.param.name; });

GridSpec grid(int x, int y, int z) {
  return {Eigen::Vector3d::Zero(), kResolution_m, Eigen::Vector3i(x, y, z)};
}

/// Largest difference between two fields of a grid, and whether what is known is the same.
double largest_difference_m(const DenseField& a, const DenseField& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.blocks().size(); ++i) {
    if (a.known_blocks()[i]->rows != b.known_blocks()[i]->rows)
      return std::numeric_limits<double>::infinity();
    const auto& values_a = a.blocks()[i]->distance_m;
    const auto& values_b = b.blocks()[i]->distance_m;
    for (std::size_t v = 0; v < values_a.size(); ++v) {
      largest = std::max(largest, std::abs(static_cast<double>(values_a[v] - values_b[v])));
    }
  }
  return largest;
}

class IncrementalField : public testing::TestWithParam<std::tuple<Eigen::Vector3i, Options>> {};

// The published field, block by block, against the exact transform of the same map.
TEST_P(IncrementalField, StaysNearTheExactTransformHoweverLongItRuns) {
  const auto& [size, options] = GetParam();
  WorkerPool workers(2);
  RestlessMap map(grid(size.x(), size.y(), size.z()), 17);
  const auto fiesta = incremental::make_incremental_builder(options, workers);
  const auto exact =
      edt::make_edt_builder({options.is_signed, options.max_distance_m, options.unknown}, workers);
  ASSERT_TRUE(fiesta->attach(map));
  ASSERT_TRUE(exact->attach(map));
  const double bound_m = error_bound_m(options);
  for (int step = 0; step < 300; ++step) {
    map.step();
    const MapUpdate update = map.take_update();
    const auto kept = updated(*fiesta, update);
    const auto truth = updated(*exact, update);
    ASSERT_TRUE(kept && truth);
    ASSERT_LE(largest_difference_m(*kept, *truth), bound_m + 1e-6) << "step " << step;
  }
}

INSTANTIATE_TEST_SUITE_P(
    SizesAndOptions, IncrementalField,
    testing::Combine(testing::Values(Eigen::Vector3i(75, 49, 33), Eigen::Vector3i(64, 32, 16),
                                     Eigen::Vector3i(1, 30, 70), Eigen::Vector3i(100, 1, 1)),
                     testing::Values(Options{false, 0.8, "free", "24"},
                                     Options{true, 0.33, "free", "26"},
                                     Options{true, 0.0, "free", "26"},
                                     Options{false, 0.05, "occupied", "6"},
                                     Options{true, 0.8, "occupied", "24"})));

TEST(Incremental, GivesTheSameFieldOnAnyNumberOfThreads) {
  WorkerPool one(1), four(4);
  RestlessMap map(grid(70, 40, 33), 23);
  const Options options{true, 0.8, "free", "24"};
  const auto a = incremental::make_incremental_builder(options, one);
  const auto b = incremental::make_incremental_builder(options, four);
  ASSERT_TRUE(a->attach(map) && b->attach(map));
  for (int step = 0; step < 50; ++step) {
    map.step();
    const MapUpdate update = map.take_update();
    const auto field_a = updated(*a, update);
    const auto field_b = updated(*b, update);
    ASSERT_TRUE(field_a && field_b);
    for (std::size_t i = 0; i < field_a->blocks().size(); ++i) {
      ASSERT_EQ(field_a->blocks()[i]->distance_m, field_b->blocks()[i]->distance_m);
    }
  }
}

TEST(Incremental, SharesTheBlocksThatDidNotChange) {
  WorkerPool workers(2);
  GridMap map(grid(64, 64, 64));
  const auto builder = incremental::make_incremental_builder({false, 0.2, "free", "24"}, workers);
  ASSERT_TRUE(builder->attach(map));
  map.set({8, 8, 8}, true);
  const auto before = updated(*builder, map.take_update());
  map.set({40, 40, 40}, true);
  const auto after = updated(*builder, map.take_update());
  ASSERT_TRUE(before && after);
  int replaced = 0;
  for (std::size_t i = 0; i < before->blocks().size(); ++i) {
    replaced += before->blocks()[i] != after->blocks()[i] ? 1 : 0;
  }
  // The new obstacle lies in the middle of a block and reaches 3 voxels: its own block only.
  EXPECT_EQ(replaced, 1);
}

/// Alone, an obstacle is found by every voxel, however far: nothing there to be mistaken for it.
TEST(Incremental, MeasuresLongDistancesToOneObstacleExactly) {
  WorkerPool workers(1);
  GridMap map(grid(700, 3, 40));
  const Eigen::Vector3i obstacle(3, 1, 39);
  map.set(obstacle, true);
  const auto builder = incremental::make_incremental_builder({false, 0.0, "free", "24"}, workers);
  ASSERT_TRUE(builder->attach(map));
  const auto field = updated(*builder, map.take_update());
  ASSERT_TRUE(field);
  EXPECT_EQ(field->info().max_distance_m, std::numeric_limits<double>::infinity());
  for (int z = 0; z < 40; ++z) {
    for (int x = 0; x < 700; ++x) {
      const Eigen::Vector3i voxel(x, 2, z);
      const int d2 = (voxel - obstacle).squaredNorm();
      ASSERT_EQ(field->at(voxel), static_cast<float>(0.05 * std::sqrt(static_cast<double>(d2))));
    }
  }
}

TEST(Incremental, RefusesAGridThatItCannotIndex) {
  WorkerPool workers(1);
  GridMap map(grid(1100, 1, 1));
  const auto attached =
      incremental::make_incremental_builder({false, 0.0, "free", "24"}, workers)->attach(map);
  ASSERT_FALSE(attached);
  EXPECT_EQ(attached.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(attached.error().hint.find("max_distance_m"), std::string::npos);
}

}  // namespace
}  // namespace sidestep::conformance
