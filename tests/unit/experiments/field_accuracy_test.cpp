#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <sidestep/measures/field_accuracy.hpp>
#include <sidestep/results/statistics.hpp>
#include "conformance/grid_map.hpp"

namespace sidestep {
namespace {

using conformance::GridMap;

GridSpec small_grid() { return {{-0.3, 0.1, -0.2}, 0.05, {21, 9, 13}}; }

/// By definition: the least distance between centres, over all pairs of voxels.
double brute_force_m(const GridSpec& grid, const std::vector<std::uint8_t>& obstacles,
                     const Eigen::Vector3i& from, double max_distance_m, bool is_signed) {
  const bool inside = obstacles[grid.linear(from)] != 0;
  double least_m = max_distance_m;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const bool is_goal = (obstacles[grid.linear({x, y, z})] != 0) != inside;
        if (!is_goal) continue;
        const double distance = (Eigen::Vector3i(x, y, z) - from).cast<double>().norm();
        least_m = std::min(least_m, grid.resolution_m * distance);
      }
    }
  }
  if (!inside) return least_m;
  return is_signed ? -least_m : 0.0;
}

template <class Visit>
void for_each_voxel(const GridSpec& grid, Visit&& visit) {
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) visit(Eigen::Vector3i(x, y, z));
    }
  }
}

TEST(ExactTransform, EqualsBruteForceOnRandomObstacles) {
  const GridSpec grid = small_grid();
  std::mt19937 random(3);
  for (const double share : {0.0, 0.002, 0.05, 0.6, 0.995, 1.0}) {
    std::bernoulli_distribution is_obstacle(share);
    std::vector<std::uint8_t> obstacles(grid.voxel_count());
    for (auto& value : obstacles) value = is_obstacle(random) ? 1 : 0;
    for (const double max_distance_m : {0.12, 0.2, 5.0}) {
      for (const bool is_signed : {false, true}) {
        const auto distances_m = exact_distances_m(grid, obstacles, max_distance_m, is_signed);
        for_each_voxel(grid, [&](const Eigen::Vector3i& voxel) {
          ASSERT_NEAR(distances_m[grid.linear(voxel)],
                      brute_force_m(grid, obstacles, voxel, max_distance_m, is_signed), 1e-6)
              << "share " << share << " cut off at " << max_distance_m << " signed " << is_signed
              << " voxel " << voxel.transpose();
        });
      }
    }
  }
}

/// A field that is a list of numbers, one a voxel; asked at centres only.
class ListedField final : public DistanceField {
 public:
  ListedField(const GridSpec& grid, bool is_signed, double value_m)
      : DistanceField({.grid = grid, .is_signed = is_signed}),
        distances_m(grid.voxel_count(), value_m),
        statuses(grid.voxel_count(), FieldStatus::kKnown) {}

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> out_m,
             std::span<Eigen::Vector3d>, std::span<FieldStatus> out) const noexcept override {
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      const std::size_t voxel = info().grid.linear(info().grid.voxel_at(points_m[i]));
      out_m[i] = distances_m[voxel];
      out[i] = statuses[voxel];
    }
  }

  std::vector<double> distances_m;
  std::vector<FieldStatus> statuses;
};

/// One occupied voxel in the middle of a free grid, and the exact field of it.
class CompareWithExact : public testing::Test {
 protected:
  static constexpr double kMax_m = 0.2;

  CompareWithExact() {
    for_each_voxel(grid_, [&](const Eigen::Vector3i& voxel) { map_.set(voxel, voxel == middle_); });
    for_each_voxel(grid_, [&](const Eigen::Vector3i& voxel) {
      const double distance_m = grid_.resolution_m * (voxel - middle_).cast<double>().norm();
      field_.distances_m[grid_.linear(voxel)] = std::min(kMax_m, distance_m);
      near_ += distance_m < kMax_m - 1e-5 ? 1 : 0;
    });
  }

  [[nodiscard]] FieldAccuracy compare() const {
    return compare_with_exact(field_, map_, kMax_m, false);
  }
  double& at(const Eigen::Vector3i& voxel) { return field_.distances_m[grid_.linear(voxel)]; }

  GridSpec grid_ = small_grid();
  Eigen::Vector3i middle_{10, 4, 6};
  GridMap map_{grid_};
  ListedField field_{grid_, false, 0.0};
  std::int64_t near_ = 0;
};

TEST_F(CompareWithExact, FindsNothingWrongWithTheExactField) {
  const FieldAccuracy accuracy = compare();
  EXPECT_EQ(accuracy.compared_vox, near_);
  EXPECT_EQ(accuracy.differing_vox, 0);
  EXPECT_LT(accuracy.max_error_m, 1e-7);
}

TEST_F(CompareWithExact, FindsAWrongValueNearAnObstacle) {
  at({12, 4, 6}) += 0.03;
  const FieldAccuracy accuracy = compare();
  EXPECT_EQ(accuracy.differing_vox, 1);
  EXPECT_NEAR(accuracy.max_error_m, 0.03, 1e-7);
  EXPECT_NEAR(accuracy.mean_error_m(), 0.03 / static_cast<double>(near_), 1e-8);
}

TEST_F(CompareWithExact, FindsAnObstacleThatIsNotThere) {
  at({0, 0, 0}) = 0.05;  // exact: beyond the cut-off
  const FieldAccuracy accuracy = compare();
  EXPECT_EQ(accuracy.compared_vox, near_ + 1);
  EXPECT_NEAR(accuracy.max_error_m, kMax_m - 0.05, 1e-7);
}

TEST_F(CompareWithExact, TakesAnythingBeyondTheCutOffForFar) {
  at({0, 0, 0}) = 7.5;
  EXPECT_LT(compare().max_error_m, 1e-7);
  at({11, 4, 6}) = 7.5;  // exact: 0.05
  EXPECT_NEAR(compare().max_error_m, kMax_m - 0.05, 1e-7);
}

TEST_F(CompareWithExact, IsInfinitelyWrongWhereTheFieldIsNotANumber) {
  at({11, 4, 6}) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(compare().max_error_m, std::numeric_limits<double>::infinity());
}

TEST_F(CompareWithExact, LeavesOutWhatTheFieldDoesNotKnow) {
  at({12, 4, 6}) += 0.03;
  field_.statuses[grid_.linear({12, 4, 6})] = FieldStatus::kUnknown;
  EXPECT_EQ(compare().differing_vox, 0);
  EXPECT_EQ(compare().compared_vox, near_ - 1);
}

TEST(CompareWithExactMap, TakesUnseenVoxelsForObstaclesWhereTheFieldDoes) {
  const GridSpec grid = small_grid();
  GridMap map(grid);
  for_each_voxel(grid, [&](const Eigen::Vector3i& voxel) {
    if (voxel.x() < 10) map.set(voxel, false);
  });
  ListedField free(grid, false, 0.2), occupied(grid, false, 0.0);
  for_each_voxel(grid, [&](const Eigen::Vector3i& voxel) {
    const double to_unseen_m = grid.resolution_m * std::max(0, 10 - voxel.x());
    occupied.distances_m[grid.linear(voxel)] = std::min(0.2, to_unseen_m);
  });
  EXPECT_LT(compare_with_exact(free, map, 0.2, false).max_error_m, 1e-7);
  EXPECT_LT(compare_with_exact(occupied, map, 0.2, true).max_error_m, 1e-7);
  EXPECT_NEAR(compare_with_exact(free, map, 0.2, true).max_error_m, 0.2, 1e-7);
}

TEST(CompareWithExactMap, TellsSignsApart) {
  const GridSpec grid = small_grid();
  GridMap map(grid);
  for_each_voxel(grid, [&](const Eigen::Vector3i& voxel) { map.set(voxel, voxel.x() < 10); });
  ListedField field(grid, true, 0.0);
  for_each_voxel(grid, [&](const Eigen::Vector3i& voxel) {
    const int steps = voxel.x() < 10 ? voxel.x() - 10 : voxel.x() - 9;
    field.distances_m[grid.linear(voxel)] = std::clamp(0.05 * steps, -0.2, 0.2);
  });
  EXPECT_LT(compare_with_exact(field, map, 0.2, false).max_error_m, 1e-7);
  for (double& distance_m : field.distances_m) distance_m = std::abs(distance_m);
  EXPECT_NEAR(compare_with_exact(field, map, 0.2, false).max_error_m, 0.4, 1e-7);
}

TEST(FieldAccuracy, AddsUp) {
  FieldAccuracy sum;
  sum.add({10, 1, 0.5, 1.0});
  sum.add({30, 2, 0.25, 1.0});
  EXPECT_EQ(sum.compared_vox, 40);
  EXPECT_EQ(sum.differing_vox, 3);
  EXPECT_EQ(sum.max_error_m, 0.5);
  EXPECT_DOUBLE_EQ(sum.mean_error_m(), 0.05);
}

TEST(Statistics, AreThoseOfTheSample) {
  const Statistics s = statistics_of({2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0});
  EXPECT_DOUBLE_EQ(s.mean, 5.0);
  EXPECT_NEAR(s.sd, std::sqrt(32.0 / 7.0), 1e-12);
  EXPECT_DOUBLE_EQ(s.p50, 4.5);
  EXPECT_DOUBLE_EQ(s.max, 9.0);
  EXPECT_EQ(statistics_of({}).mean, 0.0);
  EXPECT_EQ(statistics_of({3.0}).sd, 0.0);
}

}  // namespace
}  // namespace sidestep
