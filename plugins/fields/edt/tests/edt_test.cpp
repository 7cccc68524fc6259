#include "edt_field.hpp"

#include <cmath>
#include <limits>
#include <random>
#include <tuple>

#include <sidestep/field/dense_field.hpp>

#include "conformance/field_conformance.hpp"
#include "support/restless_map.hpp"

namespace sidestep::conformance {
namespace {

using testing_support::RestlessMap;
using testing_support::updated;

FieldCase edt_case(std::string name, bool is_signed, double max_distance_m, std::string unknown) {
  FieldCase field;
  field.name = std::move(name);
  field.is_signed = is_signed;
  field.unknown_is_occupied = unknown == "occupied";
  if (max_distance_m > 0.0) field.max_distance_m = max_distance_m;
  const edt::Options options{is_signed, max_distance_m, std::move(unknown)};
  field.create = [options](WorkerPool& workers) { return edt::make_edt_builder(options, workers); };
  return field;
}

// 0.4 m is a whole number of voxels, 0.33 m is not, 0.05 m is a single one.
INSTANTIATE_TEST_SUITE_P(edt, FieldConformance,
                         testing::Values(edt_case("unsigned", false, 0.4, "free"),
                                         edt_case("signed", true, 0.4, "free"),
                                         edt_case("between_voxels", false, 0.33, "free"),
                                         edt_case("one_voxel", true, 0.05, "free"),
                                         edt_case("unlimited", false, 0.0, "free"),
                                         edt_case("signed_unlimited", true, 0.0, "free"),
                                         edt_case("unknown_occupied", true, 0.4, "occupied")),
                         [](const testing::TestParamInfo<FieldCase>& tested) {
                           return tested.param.name;
                         });

GridSpec cube(int side) { return {Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i::Constant(side)}; }

class EdtIncrement : public testing::TestWithParam<std::tuple<Eigen::Vector3i, edt::Options>> {};

TEST_P(EdtIncrement, EqualsAFullTransformBitForBit) {
  const auto& [size, options] = GetParam();
  WorkerPool workers(2);
  RestlessMap map({Eigen::Vector3d::Zero(), 0.05, size}, 11);
  const auto incremental = edt::make_edt_builder(options, workers);
  ASSERT_TRUE(incremental->attach(map));
  for (int step = 0; step < 100; ++step) {
    map.step();
    const MapUpdate update = map.take_update();
    const auto kept = updated(*incremental, update);
    const auto full = edt::make_edt_builder(options, workers);
    ASSERT_TRUE(full->attach(map));
    const auto fresh = updated(*full, update);
    ASSERT_TRUE(kept && fresh);
    for (std::size_t b = 0; b < kept->blocks().size(); ++b) {
      ASSERT_EQ(kept->blocks()[b]->distance_m, fresh->blocks()[b]->distance_m)
          << "block " << b << ", step " << step;
      ASSERT_EQ(kept->known_blocks()[b]->rows, fresh->known_blocks()[b]->rows)
          << "block " << b << ", step " << step;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    SizesAndOptions, EdtIncrement,
    testing::Combine(testing::Values(Eigen::Vector3i(75, 49, 33), Eigen::Vector3i(130, 20, 17),
                                     Eigen::Vector3i(64, 32, 16), Eigen::Vector3i(7, 65, 64),
                                     Eigen::Vector3i(1, 30, 70), Eigen::Vector3i(100, 1, 1)),
                     testing::Values(edt::Options{false, 0.8, "free"},
                                     edt::Options{true, 0.33, "free"},
                                     edt::Options{true, 0.0, "free"},
                                     edt::Options{false, 0.05, "occupied"},
                                     edt::Options{true, 0.8, "occupied"})));

/// Every voxel against every obstacle, from the definition.
float brute_force_m(const GridMap& map, const Eigen::Vector3i& voxel, bool is_signed,
                    double limit_m) {
  const GridSpec& grid = map.grid();
  const bool is_inside = map.occupied().at(grid, voxel);
  if (is_inside && !is_signed) return 0.0f;
  int least2 = std::numeric_limits<int>::max();
  Eigen::Vector3i other;
  for (other.z() = 0; other.z() < grid.size_vox.z(); ++other.z()) {
    for (other.y() = 0; other.y() < grid.size_vox.y(); ++other.y()) {
      for (other.x() = 0; other.x() < grid.size_vox.x(); ++other.x()) {
        if (map.occupied().at(grid, other) == is_inside) continue;
        least2 = std::min(least2, (other - voxel).squaredNorm());
      }
    }
  }
  const double distance_m =
      std::min(limit_m, grid.resolution_m * std::sqrt(static_cast<double>(least2)));
  return static_cast<float>(is_inside ? -distance_m : distance_m);
}

class EdtSequence : public testing::TestWithParam<edt::Options> {};

/// The corner where eight blocks meet lies in the middle of the grid.
TEST_P(EdtSequence, EqualsBruteForceThroughThousandsOfSteps) {
  constexpr int kSteps = 2000;
  constexpr int kVoxelsAStep = 40;
  const edt::Options& options = GetParam();
  WorkerPool workers(2);
  RestlessMap map({Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(33, 20, 18)}, 5);
  map.set({0, 0, 0}, true);  // so that there always is an obstacle
  const auto builder = edt::make_edt_builder(options, workers);
  ASSERT_TRUE(builder->attach(map));
  std::mt19937 random(6);
  for (int step = 0; step < kSteps; ++step) {
    map.step();
    map.set({0, 0, 0}, true);
    const auto field = updated(*builder, map.take_update());
    ASSERT_TRUE(field);
    for (int n = 0; n < kVoxelsAStep; ++n) {
      Eigen::Vector3i voxel;
      for (int axis = 0; axis < 3; ++axis) {
        voxel[axis] = std::uniform_int_distribution<int>(0, map.grid().size_vox[axis] - 1)(random);
      }
      ASSERT_EQ(field->at(voxel),
                brute_force_m(map, voxel, options.is_signed, options.max_distance_m))
          << "step " << step << ", voxel " << voxel.transpose();
    }
  }
}

// 10 m is 200 voxels: squared distances of more than 16 bits, another transform.
INSTANTIATE_TEST_SUITE_P(NearAndFar, EdtSequence,
                         testing::Values(edt::Options{false, 0.33, "free"},
                                         edt::Options{true, 0.8, "free"},
                                         edt::Options{true, 10.0, "free"}));

/// Beyond 32767 a squared distance needs 32 bits.
TEST(Edt, MeasuresLongDistancesExactly) {
  WorkerPool workers(2);
  GridMap map({Eigen::Vector3d::Zero(), 0.05, Eigen::Vector3i(700, 3, 40)});
  const Eigen::Vector3i obstacle(3, 1, 39);
  map.set(obstacle, true);
  const auto builder = edt::make_edt_builder({false, 0.0, "free"}, workers);
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

TEST(Edt, SharesTheBlocksThatDidNotChange) {
  WorkerPool workers(2);
  GridMap map(cube(64));
  const auto builder = edt::make_edt_builder({false, 0.2, "free"}, workers);
  ASSERT_TRUE(builder->attach(map));
  map.set({8, 8, 8}, true);
  const auto before = builder->update(map.take_update());
  map.set({40, 40, 40}, true);
  const auto after = builder->update(map.take_update());
  ASSERT_TRUE(before && after);
  const auto& a = dynamic_cast<const DenseField&>(**before).blocks();
  const auto& b = dynamic_cast<const DenseField&>(**after).blocks();
  int replaced = 0;
  for (std::size_t i = 0; i < a.size(); ++i) replaced += a[i] != b[i] ? 1 : 0;
  // The new obstacle lies in the middle of a block and reaches 3 voxels: its own block only.
  EXPECT_EQ(replaced, 1);
}

TEST(Edt, AnEmptyMapWithoutLimitStaysFinite) {
  WorkerPool workers(1);
  GridMap map(cube(20));
  const auto builder = edt::make_edt_builder({false, 0.0, "free"}, workers);
  ASSERT_TRUE(builder->attach(map));
  const auto field = builder->update(map.take_update());
  ASSERT_TRUE(field);
  const Eigen::Vector3d p(0.5, 0.5, 0.5);
  double d = 0.0;
  Eigen::Vector3d gradient;
  (*field)->query({&p, 1}, {&d, 1}, {&gradient, 1}, {});
  EXPECT_TRUE(std::isfinite(d));
  EXPECT_GE(d, 20 * 0.05);
  EXPECT_EQ(gradient, Eigen::Vector3d::Zero());
}

TEST(Edt, UpdateBeforeAttachIsAnError) {
  WorkerPool workers(1);
  const auto field = edt::make_edt_builder({false, 0.8, "free"}, workers)->update({});
  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace sidestep::conformance
