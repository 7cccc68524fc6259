#include "cloud_filters.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pcd_testing.hpp"

namespace sidestep::pcd {
namespace {

using ::testing::HasSubstr;
using testing::Points;

Points scattered(int count, unsigned seed, float side_m = 1.0F) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> at(0.0F, side_m);
  Points points;
  for (int i = 0; i < count; ++i) points.emplace_back(at(random), at(random), at(random));
  return points;
}

Points sorted(Points points) {
  std::ranges::sort(points, [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return std::tuple(a.x(), a.y(), a.z()) < std::tuple(b.x(), b.y(), b.z());
  });
  return points;
}

Points filtered(const std::vector<Filter>& filters, const Points& points,
                const Transform& T_world_camera = Transform::Identity(), std::uint64_t seed = 1) {
  const auto result = apply_filters(filters, points, T_world_camera, seed);
  EXPECT_TRUE(result) << result.error().describe();
  return result.value_or(Points{});
}

TEST(CloudFilters, WithoutFiltersNothingChanges) {
  const Points points = scattered(100, 1);
  EXPECT_EQ(filtered({}, points), points);
}

TEST(CloudFilters, VoxelLeavesTheMeanOfEachCube) {
  const Points points = scattered(3000, 2);
  constexpr double kLeaf_m = 0.125;  // exact in binary, so that no point is on the wrong side
  std::map<std::tuple<int, int, int>, std::pair<Eigen::Vector3d, int>> cubes;
  for (const Eigen::Vector3f& p : points) {
    const Eigen::Vector3i cube = (p.cast<double>() / kLeaf_m).array().floor().cast<int>();
    auto& [sum, count] =
        cubes.try_emplace({cube.x(), cube.y(), cube.z()}, Eigen::Vector3d::Zero(), 0).first->second;
    sum += p.cast<double>();
    ++count;
  }
  Points means;
  for (const auto& [cube, sum] : cubes) {
    means.push_back((sum.first / sum.second).cast<float>());
  }
  const Points expected = sorted(means);
  const Points kept = sorted(filtered({{.voxel = VoxelFilter{kLeaf_m}}}, points));
  ASSERT_EQ(kept.size(), expected.size());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_TRUE(kept[i].isApprox(expected[i], 1e-5F)) << i;
  }
}

TEST(CloudFilters, VoxelRefusesALeafThatPclWouldSilentlyIgnore) {
  const auto result = apply_filters({{.voxel = VoxelFilter{1e-4}}}, {{0, 0, 0}, {9, 9, 9}},
                                    Transform::Identity(), 1);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kBadFrame);
  EXPECT_THAT(result.error().describe(), HasSubstr("source.filters[0].voxel: leaf_m is too small"));
}

// The definition, by comparing all points with all: keep those whose mean distance to the k nearest
// is at most the mean over all points plus so many standard deviations.
TEST(CloudFilters, OutlierKeepsThePointsThatTheDefinitionKeeps) {
  Points points = scattered(400, 3, 0.5F);
  for (int i = 0; i < 10; ++i) points.emplace_back(2.0F + 0.5F * i, 0.1F * i, -1.0F);
  constexpr int kNeighbours = 12;
  constexpr double kDeviations = 1.5;
  std::vector<double> means;
  for (const Eigen::Vector3f& p : points) {
    std::vector<double> distances;
    for (const Eigen::Vector3f& q : points) {
      distances.push_back((p - q).cast<double>().norm());
    }
    std::ranges::sort(distances);
    double sum = 0.0;
    for (int i = 1; i <= kNeighbours; ++i) sum += distances[static_cast<std::size_t>(i)];
    means.push_back(sum / kNeighbours);
  }
  double mean = 0.0, squares = 0.0;
  for (const double m : means) mean += m / static_cast<double>(means.size());
  for (const double m : means) squares += (m - mean) * (m - mean);
  const double limit =
      mean + kDeviations * std::sqrt(squares / static_cast<double>(means.size() - 1));
  Points expected;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (means[i] <= limit) expected.push_back(points[i]);
  }
  ASSERT_LT(expected.size(), points.size());
  EXPECT_EQ(filtered({{.outlier = OutlierFilter{kNeighbours, kDeviations}}}, points), expected);
}

TEST(CloudFilters, OutlierNeedsAsManyPointsAsNeighbours) {
  const auto result = apply_filters({{.outlier = OutlierFilter{20, 1.0}}}, scattered(20, 1),
                                    Transform::Identity(), 1);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().describe(), HasSubstr("a cloud of 20 points has no 20 neighbours"));
}

TEST(CloudFilters, CropCutsInTheFrameThatItIsGivenIn) {
  const Points points = scattered(2000, 4);
  Transform T_world_camera = Transform::Identity();
  T_world_camera.translation() = Eigen::Vector3d(10, 0, 0);
  T_world_camera.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  CropFilter crop{{9.8, -0.3, 0.1}, {10.4, 0.5, 0.9}, "world", "inside"};
  for (const std::string frame : {"world", "camera"}) {
    if (frame == "camera") crop = {{0.2, 0.1, 0.3}, {0.7, 0.8, 0.6}, "camera", "inside"};
    Points inside, outside;
    for (const Eigen::Vector3f& p : points) {
      const Eigen::Vector3d q =
          frame == "world" ? T_world_camera * p.cast<double>() : p.cast<double>();
      const bool in =
          (q.array() >= crop.min_m.array()).all() && (q.array() <= crop.max_m.array()).all();
      (in ? inside : outside).push_back(p);
    }
    ASSERT_GT(inside.size(), 50U);
    crop.keep = "inside";
    EXPECT_EQ(filtered({{.crop = crop}}, points, T_world_camera), inside) << frame;
    crop.keep = "outside";
    EXPECT_EQ(filtered({{.crop = crop}}, points, T_world_camera), outside) << frame;
  }
}

/// 700 points within 5 mm of a slanted plane, 300 at least 0.1 m off it, mixed.
class SlantedPlane {
 public:
  SlantedPlane() {
    std::mt19937 random(6);
    std::uniform_real_distribution<double> along(-1.0, 1.0), near(-0.005, 0.005), off(0.1, 0.6);
    for (int i = 0; i < 1000; ++i) {
      const bool on = i % 10 < 7;
      const Eigen::Vector3d p = along(random) * u_ + along(random) * v_ +
                                (on ? near(random) : off(random)) * normal_ +
                                Eigen::Vector3d(0.2, -0.1, 2.0);
      points.push_back(p.cast<float>());
      if (!on) rest.push_back(points.back());
    }
  }
  Points points, rest;

 private:
  Eigen::Vector3d normal_ = Eigen::Vector3d(1, 2, 4).normalized();
  Eigen::Vector3d u_ = normal_.unitOrthogonal();
  Eigen::Vector3d v_ = normal_.cross(u_);
};

TEST(CloudFilters, PlaneRemovesThePlaneAndNothingElse) {
  const SlantedPlane scene;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    EXPECT_EQ(filtered({{.plane = PlaneFilter{0.03, 0.5, 200}}}, scene.points,
                       Transform::Identity(), seed),
              scene.rest);
  }
}

TEST(CloudFilters, PlaneStaysWhereItsShareIsTooSmall) {
  const SlantedPlane scene;
  EXPECT_EQ(filtered({{.plane = PlaneFilter{0.03, 0.75, 200}}}, scene.points), scene.points);
}

TEST(CloudFilters, PlaneTriesWhatTheSeedSays) {
  // Without any plane the best of few tries depends on the seed.
  const Points points = scattered(300, 9);
  const std::vector<Filter> filters = {{.plane = PlaneFilter{0.05, 0.0, 2}}};
  const auto at = [&](std::uint64_t seed) {
    return filtered(filters, points, Transform::Identity(), seed);
  };
  int others = 0;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    EXPECT_EQ(at(seed), at(seed));
    others += at(seed) != at(0) ? 1 : 0;
  }
  EXPECT_GT(others, 0);
}

TEST(CloudFilters, FollowTheOrderGiven) {
  // A lone point is an outlier of the whole cloud, but all there is of a crop.
  Points points = scattered(200, 5, 0.2F);
  points.emplace_back(5.0F, 5.0F, 5.0F);
  const Filter outlier{.outlier = OutlierFilter{5, 2.0}};
  const Filter crop{.crop = CropFilter{{4, 4, 4}, {6, 6, 6}, "camera", "inside"}};
  const auto outlier_first = apply_filters({outlier, crop}, points, Transform::Identity(), 1);
  ASSERT_FALSE(outlier_first);
  EXPECT_THAT(outlier_first.error().describe(), HasSubstr("source.filters[1] left none of "));
  const auto crop_first = apply_filters({crop, outlier}, points, Transform::Identity(), 1);
  ASSERT_FALSE(crop_first);
  EXPECT_THAT(crop_first.error().describe(),
              HasSubstr("source.filters[1].outlier: a cloud of 1 points"));
}

}  // namespace
}  // namespace sidestep::pcd
