#include "edt_field.hpp"

#include <sidestep/field/dense_field.hpp>

#include "conformance/field_conformance.hpp"

namespace sidestep::conformance {
namespace {

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

TEST(Edt, IncrementalEqualsFullBitForBit) {
  std::mt19937 random(11);
  const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  WorkerPool workers(2);
  for (const bool is_signed : {false, true}) {
    const edt::Options options{is_signed, 0.8, "free"};
    GridMap map(cube(75));
    const auto incremental = edt::make_edt_builder(options, workers);
    ASSERT_TRUE(incremental->attach(map));
    for (int step = 0; step < 25; ++step) {
      const Eigen::Vector3i corner(below(70), below(70), below(70));
      const bool appears = below(3) != 0;
      for (int i = 0; i < 125; ++i) {
        map.set(corner + Eigen::Vector3i(i % 5, i / 5 % 5, i / 25), appears);
      }
      const MapUpdate update = map.take_update();
      const auto kept = incremental->update(update);
      const auto full = edt::make_edt_builder(options, workers);
      ASSERT_TRUE(full->attach(map));
      const auto fresh = full->update(update);
      ASSERT_TRUE(kept && fresh);
      const auto& a = dynamic_cast<const DenseField&>(**kept).blocks();
      const auto& b = dynamic_cast<const DenseField&>(**fresh).blocks();
      for (std::size_t i = 0; i < a.size(); ++i) {
        ASSERT_EQ(a[i]->distance_m, b[i]->distance_m) << "block " << i << ", step " << step;
        ASSERT_EQ(a[i]->known, b[i]->known) << "block " << i << ", step " << step;
      }
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
