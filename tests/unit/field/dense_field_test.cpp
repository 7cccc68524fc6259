#include <sidestep/core/index.hpp>
#include <sidestep/field/dense_field.hpp>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

using Function = std::function<double(const Eigen::Vector3d& p_world)>;

GridSpec grid_of(int x, int y, int z) {
  GridSpec grid;
  grid.origin_m = Eigen::Vector3d(-1.0, 2.0, 0.5);
  grid.resolution_m = 0.25;
  grid.size_vox = {x, y, z};
  return grid;
}

/// The function sampled at voxel centres; what lies beyond the grid within a block is NaN, so
/// that reading it shows. Known are the voxels for which known() says so.
DenseField sampled(const GridSpec& grid, const Function& function,
                   const std::function<bool(const Eigen::Vector3i&)>& known) {
  const Eigen::Vector3i counts = block_counts(grid);
  std::vector<DenseField::Blocks::Entry> table;
  std::vector<DenseField::KnownBlocks::Entry> known_table;
  for (int b = 0; b < counts.prod(); ++b) {
    const Eigen::Vector3i block(b % counts.x(), b / counts.x() % counts.y(),
                                b / counts.x() / counts.y());
    auto out = std::make_shared<FieldBlock>();
    out->distance_m.fill(std::numeric_limits<float>::quiet_NaN());
    auto out_known = std::make_shared<KnownBlock>();
    out_known->rows.fill(0);
    for (int n = 0; n < FieldBlock::kVoxels; ++n) {
      const Eigen::Vector3i in(n % 16, n / 16 % 16, n / 256);
      const Eigen::Vector3i voxel = block * 16 + in;
      if (!grid.contains(voxel)) continue;
      out->distance_m[static_cast<std::size_t>(n)] =
          static_cast<float>(function(grid.centre_m(voxel)));
      if (known(voxel)) {
        auto& row = out_known->rows[static_cast<std::size_t>(n / 16)];
        row = static_cast<std::uint16_t>(row | (1u << in.x()));
      }
    }
    table.push_back(std::move(out));
    known_table.push_back(std::move(out_known));
  }
  FieldInfo info;
  info.grid = grid;
  return DenseField(info, std::move(table), std::move(known_table));
}

bool always(const Eigen::Vector3i&) { return true; }

struct Answer {
  double distance_m;
  Eigen::Vector3d gradient;
  FieldStatus status;
};

Answer ask(const DistanceField& field, const Eigen::Vector3d& p) {
  Answer answer{};
  field.query({&p, 1}, {&answer.distance_m, 1}, {&answer.gradient, 1}, {&answer.status, 1});
  return answer;
}

/// Multilinear in x, y and z: what trilinear interpolation reproduces exactly. Its coefficients
/// and the centres of the grids are short binary fractions, so that floats hold its values.
double multilinear(const Eigen::Vector3d& p) {
  return 1.0 + 0.5 * p.x() - 0.25 * p.y() + 2.0 * p.z() + 0.5 * p.x() * p.y() - p.y() * p.z() +
         0.25 * p.x() * p.z() + 0.5 * p.x() * p.y() * p.z();
}

Eigen::Vector3d slope(const Eigen::Vector3d& p) {
  return {0.5 + 0.5 * p.y() + 0.25 * p.z() + 0.5 * p.y() * p.z(),
          -0.25 + 0.5 * p.x() - p.z() + 0.5 * p.x() * p.z(),
          2.0 - p.y() + 0.25 * p.x() + 0.5 * p.x() * p.y()};
}

class DenseFieldOfSize : public testing::TestWithParam<Eigen::Vector3i> {
 protected:
  GridSpec grid_ = grid_of(GetParam().x(), GetParam().y(), GetParam().z());
};

INSTANTIATE_TEST_SUITE_P(Sizes, DenseFieldOfSize,
                         testing::Values(Eigen::Vector3i(16, 16, 16), Eigen::Vector3i(33, 17, 20),
                                         Eigen::Vector3i(5, 40, 2), Eigen::Vector3i(1, 18, 33)));

TEST_P(DenseFieldOfSize, HoldsTheValueOfEveryVoxel) {
  const auto known = [](const Eigen::Vector3i& v) { return (v.x() + 2 * v.y() + v.z()) % 3 == 0; };
  const DenseField field = sampled(grid_, multilinear, known);
  for (int z = 0; z < grid_.size_vox.z(); ++z) {
    for (int y = 0; y < grid_.size_vox.y(); ++y) {
      for (int x = 0; x < grid_.size_vox.x(); ++x) {
        const Eigen::Vector3i voxel(x, y, z);
        const Eigen::Vector3d centre = grid_.centre_m(voxel);
        ASSERT_EQ(field.at(voxel), static_cast<float>(multilinear(centre)));
        ASSERT_EQ(field.known(voxel), known(voxel));
        const Answer answer = ask(field, centre);
        ASSERT_NEAR(answer.distance_m, multilinear(centre), 1e-5);
        ASSERT_EQ(answer.status, known(voxel) ? FieldStatus::kKnown : FieldStatus::kUnknown);
      }
    }
  }
}

TEST_P(DenseFieldOfSize, ReproducesAMultilinearFunctionAndItsGradient) {
  const DenseField field = sampled(grid_, multilinear, always);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> within(0.0, 1.0);
  const Eigen::Vector3d first = grid_.centre_m({0, 0, 0});
  const Eigen::Vector3d last = grid_.centre_m(grid_.size_vox - Eigen::Vector3i::Ones());
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p =
        first +
        Eigen::Vector3d(within(random), within(random), within(random)).cwiseProduct(last - first);
    const Answer answer = ask(field, p);
    ASSERT_NEAR(answer.distance_m, multilinear(p), 1e-4);
    for (int axis = 0; axis < 3; ++axis) {
      // A grid one voxel wide says nothing of the slope across it.
      const double expected = grid_.size_vox[axis] == 1 ? 0.0 : slope(p)[axis];
      ASSERT_NEAR(answer.gradient[axis], expected, 1e-3) << p.transpose();
    }
    ASSERT_EQ(answer.status, FieldStatus::kKnown);
  }
}

TEST_P(DenseFieldOfSize, ClampsToTheOutermostCentres) {
  const DenseField field = sampled(grid_, multilinear, always);
  const Eigen::Vector3d first = grid_.centre_m({0, 0, 0});
  const Eigen::Vector3d last = grid_.centre_m(grid_.size_vox - Eigen::Vector3i::Ones());
  std::mt19937 random(2);
  std::uniform_real_distribution<double> within(-2.0, 2.0);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p =
        0.5 * (first + last) + Eigen::Vector3d(within(random), within(random), within(random))
                                   .cwiseProduct(grid_.upper_m() - grid_.origin_m);
    const Eigen::Vector3d inner = p.cwiseMax(first).cwiseMin(last);
    const Answer answer = ask(field, p);
    ASSERT_NEAR(answer.distance_m, multilinear(inner), 1e-4);
    for (int axis = 0; axis < 3; ++axis) {
      if (p[axis] != inner[axis]) {
        ASSERT_EQ(answer.gradient[axis], 0.0);
      } else {
        ASSERT_NEAR(answer.gradient[axis], slope(inner)[axis], 1e-3);
      }
    }
    const bool outside =
        (p.array() < grid_.origin_m.array()).any() || (p.array() > grid_.upper_m().array()).any();
    ASSERT_EQ(answer.status, outside ? FieldStatus::kOutside : FieldStatus::kKnown);
  }
}

TEST(DenseField, TheNearestVoxelDecidesWhatIsKnown) {
  const GridSpec grid = grid_of(20, 20, 20);
  const DenseField field = sampled(
      grid, multilinear, [](const Eigen::Vector3i& v) { return v == Eigen::Vector3i(15, 7, 3); });
  const Eigen::Vector3d centre = grid.centre_m({15, 7, 3});
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector3d half = Eigen::Vector3d::Unit(axis) * side * 0.5 * grid.resolution_m;
      EXPECT_EQ(ask(field, centre + 0.99 * half).status, FieldStatus::kKnown);
      EXPECT_EQ(ask(field, centre + 1.01 * half).status, FieldStatus::kUnknown);
    }
  }
}

TEST(DenseField, WhatIsNotFiniteIsOutside) {
  const DenseField field = sampled(grid_of(20, 20, 20), multilinear, always);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity}) {
    for (int axis = 0; axis < 3; ++axis) {
      Eigen::Vector3d p(1.0, 4.0, 2.0);
      p[axis] = bad;
      const Answer answer = ask(field, p);
      EXPECT_TRUE(std::isnan(answer.distance_m));
      EXPECT_EQ(answer.gradient, Eigen::Vector3d::Zero());
      EXPECT_EQ(answer.status, FieldStatus::kOutside);
    }
  }
  for (const double far : {1e30, -1e30, 1e308, -1e308}) {
    const Answer answer = ask(field, Eigen::Vector3d::Constant(far));
    EXPECT_EQ(answer.gradient, Eigen::Vector3d::Zero());
    EXPECT_EQ(answer.status, FieldStatus::kOutside);
  }
}

TEST(DenseField, ABatchIsItsPointsOneByOne) {
  const DenseField field = sampled(grid_of(33, 17, 20), multilinear, always);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(-3.0, 9.0);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 101; ++i) {
    points.emplace_back(within(random), within(random), within(random));
  }
  points[50].y() = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> distances(points.size()), alone(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  std::vector<FieldStatus> statuses(points.size());
  field.query(points, distances, gradients, statuses);
  field.query(points, alone, {}, {});
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Answer answer = ask(field, points[i]);
    if (i != 50) {
      EXPECT_EQ(distances[i], answer.distance_m);
      EXPECT_EQ(alone[i], answer.distance_m);
    }
    EXPECT_EQ(gradients[i], answer.gradient);
    EXPECT_EQ(statuses[i], answer.status);
  }
  field.query({}, {}, {}, {});
}

TEST(DenseField, ListsPointsOutsideWhereNoObstacleIsAnywhere) {
  constexpr float kNone = std::numeric_limits<float>::infinity();
  const GridSpec grid = grid_of(20, 20, 20);
  const DenseField field = sampled(
      grid, [](const Eigen::Vector3d&) { return kNone; }, always);
  PointFloats points_m;
  std::fill_n(points_m.x, kFloatLanes, static_cast<float>(grid.upper_m().x()) + 1.0F);
  std::fill_n(points_m.y, kFloatLanes, static_cast<float>(grid.origin_m.y()) + 1.0F);
  std::fill_n(points_m.z, kFloatLanes, static_cast<float>(grid.origin_m.z()) + 1.0F);
  const double limit_m = 0.3;
  std::vector<FieldSample> samples(kFloatLanes);
  ASSERT_EQ(field.query_below({&points_m, 1}, {&limit_m, 1}, false, samples), kFloatLanes);
  for (const FieldSample& sample : samples) EXPECT_EQ(sample.status, FieldStatus::kOutside);
}

TEST(DenseField, ListsPointsOfMoreThanAMillionBlocks) {
  const GridSpec grid = grid_of(16 * 1025, 16 * 1024, 16);
  const auto count = static_cast<std::size_t>(block_counts(grid).prod());
  auto far = std::make_shared<FieldBlock>(), near = std::make_shared<FieldBlock>();
  far->distance_m.fill(2.0F);
  near->distance_m.fill(0.25F);
  std::vector<DenseField::Blocks::Entry> blocks(count, far);
  blocks.back() = near;
  auto known = std::make_shared<KnownBlock>();
  known->rows.fill(0xffff);
  FieldInfo info;
  info.grid = grid;
  info.lipschitz = 1.0;
  const DenseField field(info, blocks, std::vector<DenseField::KnownBlocks::Entry>(count, known));
  const Eigen::Vector3f last_m = (grid.upper_m().array() - 1.0).cast<float>();
  PointFloats points_m;
  std::fill_n(points_m.x, kFloatLanes, last_m.x());
  std::fill_n(points_m.y, kFloatLanes, last_m.y());
  std::fill_n(points_m.z, kFloatLanes, last_m.z());
  const double limit_m = 0.5;
  std::vector<FieldSample> samples(kFloatLanes);
  ASSERT_EQ(field.query_below({&points_m, 1}, {&limit_m, 1}, false, samples), kFloatLanes);
  EXPECT_EQ(samples.back().point, kFloatLanes - 1);
  EXPECT_EQ(samples.back().distance_m, 0.25);
}

}  // namespace
}  // namespace sidestep
