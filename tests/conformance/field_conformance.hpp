#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/field_builder.hpp>

#include "field_oracles.hpp"
#include "grid_map.hpp"

/// What every field must do, as tests that run on yours. In one .cpp of a test program:
///
///     INSTANTIATE_TEST_SUITE_P(my_field, FieldConformance, testing::Values(FieldCase{...}));
///
/// Values are compared with a search over all obstacles, with distances to a ball and to boxes
/// known in closed form, and gradients with finite differences.
namespace sidestep::conformance {

class FieldConformance : public testing::TestWithParam<FieldCase> {
 protected:
  static GridSpec grid(int x, int y, int z) {
    GridSpec grid;
    grid.resolution_m = 0.05;
    grid.origin_m = Eigen::Vector3d(-0.5, 0.25, -0.1);
    grid.size_vox = {x, y, z};
    return grid;
  }

  void attach(const GridSpec& grid) {
    map_ = GetParam().create_map(grid);
    builder_ = GetParam().create(workers_);
    const auto attached = builder_->attach(*map_);
    ASSERT_TRUE(attached) << attached.error().describe();
  }

  std::shared_ptr<const DistanceField> update() {
    auto field = builder_->update(map_->take_update());
    EXPECT_TRUE(field) << field.error().describe();
    return field ? *field : nullptr;
  }

  void observe_all(bool occupied) {
    const Eigen::Vector3i& size = map_->grid().size_vox;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x) map_->set({x, y, z}, occupied);
      }
    }
  }

  /// Sets the voxels whose centres lie in a ball.
  void set_ball(const Eigen::Vector3d& centre_m, double radius_m, bool occupied) {
    const GridSpec& grid = map_->grid();
    for (int z = 0; z < grid.size_vox.z(); ++z) {
      for (int y = 0; y < grid.size_vox.y(); ++y) {
        for (int x = 0; x < grid.size_vox.x(); ++x) {
          if ((grid.centre_m({x, y, z}) - centre_m).norm() <= radius_m) {
            map_->set({x, y, z}, occupied);
          }
        }
      }
    }
  }

  static double distance(const DistanceField& field, const Eigen::Vector3d& p) {
    double d = 0.0;
    field.query({&p, 1}, {&d, 1}, {}, {});
    return d;
  }

  /// Values at the centres of all voxels.
  static std::vector<double> all_values(const DistanceField& field) {
    const GridSpec& grid = field.info().grid;
    std::vector<Eigen::Vector3d> centres;
    for (int z = 0; z < grid.size_vox.z(); ++z) {
      for (int y = 0; y < grid.size_vox.y(); ++y) {
        for (int x = 0; x < grid.size_vox.x(); ++x) centres.push_back(grid.centre_m({x, y, z}));
      }
    }
    std::vector<double> values(centres.size());
    field.query(centres, values, {}, {});
    return values;
  }

  void expect_equals_brute_force(const DistanceField& field) {
    const BruteForce truth(*map_, GetParam());
    if (!truth.defined()) return;
    const std::vector<double> values = all_values(field);
    const Eigen::Vector3i& size = map_->grid().size_vox;
    std::size_t n = 0;
    for (int z = 0; z < size.z(); ++z) {
      for (int y = 0; y < size.y(); ++y) {
        for (int x = 0; x < size.x(); ++x, ++n) {
          // A query at a centre rounds the position, which moves the value by about 1e-15.
          ASSERT_NEAR(values[n], static_cast<double>(truth.at({x, y, z})),
                      GetParam().max_error_m + 1e-12)
              << "voxel " << x << " " << y << " " << z << " after update " << field.info().sequence;
        }
      }
    }
  }

  WorkerPool workers_{2};
  std::unique_ptr<GridMap> map_;
  std::shared_ptr<FieldBuilder> builder_;
};

TEST_P(FieldConformance, EqualsBruteForceWhileObstaclesComeAndGo) {
  std::mt19937 random(7);
  const auto below = [&](int n) { return std::uniform_int_distribution<int>(0, n - 1)(random); };
  // Sizes around the block side and the word, and one voxel wide.
  for (const Eigen::Vector3i& size : {Eigen::Vector3i(70, 17, 5), Eigen::Vector3i(16, 33, 8),
                                      Eigen::Vector3i(64, 1, 31), Eigen::Vector3i(12, 13, 24)}) {
    attach(grid(size.x(), size.y(), size.z()));
    std::vector<Eigen::Vector3i> placed;
    for (int step = 0; step < 8; ++step) {
      for (int i = below(25); i >= 0; --i) {
        placed.push_back({below(size.x()), below(size.y()), below(size.z())});
        map_->set(placed.back(), true);
      }
      for (int i = below(static_cast<int>(placed.size())); i > 0 && step % 2 == 1; --i) {
        map_->set(placed.back(), false);
        placed.pop_back();
      }
      const auto field = update();
      ASSERT_TRUE(field);
      expect_equals_brute_force(*field);
      if (HasFatalFailure()) return;
    }
  }
}

TEST_P(FieldConformance, MeasuresTheDistanceToABall) {
  attach(grid(40, 40, 40));
  observe_all(false);
  const Eigen::Vector3d centre = map_->grid().centre_m({20, 20, 20});
  const double radius_m = 0.32;
  set_ball(centre, radius_m, true);
  const auto field = update();
  ASSERT_TRUE(field);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> offset(-0.9, 0.9);
  // The nearest obstacle's centre lies in the ball, at most a voxel's diagonal below its surface.
  const double below_surface_m = map_->grid().resolution_m * std::sqrt(3.0);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d p =
        centre + Eigen::Vector3d(offset(random), offset(random), offset(random));
    const double truth = (p - centre).norm() - radius_m;
    if (truth < below_surface_m) continue;
    const double limit = GetParam().max_distance_m;
    const double value = distance(*field, p);
    EXPECT_GE(value, std::min(truth, limit - below_surface_m) - GetParam().max_error_m - 1e-6);
    EXPECT_LE(value, std::min(truth + below_surface_m, limit) + GetParam().max_error_m + 1e-6);
  }
}

TEST_P(FieldConformance, MeasuresTheDistancesToBoxes) {
  attach(grid(66, 45, 38));
  observe_all(false);
  // A slab, a post, a cube and a single voxel, with free voxels between and around them.
  const std::vector<VoxelBox> boxes = {{{2, 3, 4}, {50, 40, 6}},
                                       {{15, 16, 10}, {17, 17, 34}},
                                       {{40, 20, 20}, {52, 32, 32}},
                                       {{63, 1, 36}, {63, 1, 36}}};
  const Eigen::Vector3i& size = map_->grid().size_vox;
  std::vector<Eigen::Vector3i> voxels;
  for (int n = 0; n < size.prod(); ++n) {
    voxels.emplace_back(n % size.x(), n / size.x() % size.y(), n / (size.x() * size.y()));
  }
  for (const VoxelBox& box : boxes) {
    for (const Eigen::Vector3i& voxel : voxels) {
      if (box.contains(voxel)) map_->set(voxel, true);
    }
  }
  const auto field = update();
  ASSERT_TRUE(field);
  const std::vector<double> values = all_values(*field);
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    double truth = std::numeric_limits<double>::infinity();
    for (const VoxelBox& box : boxes) {
      const bool below_surface = GetParam().is_signed && box.contains(voxels[n]);
      truth =
          std::min(truth, below_surface ? -box.depth_vox(voxels[n]) : box.distance_vox(voxels[n]));
    }
    const double limit = GetParam().max_distance_m;
    truth = std::clamp(truth * map_->grid().resolution_m, -limit, limit);
    ASSERT_NEAR(values[n], truth, GetParam().max_error_m + 1e-6) << voxels[n].transpose();
  }
}

TEST_P(FieldConformance, MayBeAttachedToAMapThatHasBegun) {
  const GridSpec spec = grid(40, 20, 20);
  map_ = GetParam().create_map(spec);
  observe_all(false);
  set_ball(spec.centre_m({10, 10, 10}), 0.2, true);
  (void)map_->take_update();
  builder_ = GetParam().create(workers_);
  ASSERT_TRUE(builder_->attach(*map_));
  map_->set({35, 5, 5}, true);
  const auto field = update();
  ASSERT_TRUE(field);
  expect_equals_brute_force(*field);
}

/// As after an update whose grid moved.
TEST_P(FieldConformance, AttachedAgainForgetsWhatCameBefore) {
  const GridSpec spec = grid(40, 20, 20);
  attach(spec);
  set_ball(spec.centre_m({10, 10, 10}), 0.2, true);
  const auto before = update();
  ASSERT_TRUE(before);
  const std::vector<double> values_before = all_values(*before);
  const std::unique_ptr<GridMap> first = std::move(map_);
  GridSpec moved = spec;
  moved.origin_m.x() += 16 * spec.resolution_m;
  map_ = GetParam().create_map(moved);
  set_ball(moved.centre_m({30, 10, 10}), 0.2, true);
  (void)map_->take_update();
  map_->set({35, 5, 5}, true);
  ASSERT_TRUE(builder_->attach(*map_));
  const auto field = update();
  ASSERT_TRUE(field);
  EXPECT_EQ(field->info().grid, moved);
  expect_equals_brute_force(*field);
  EXPECT_EQ(all_values(*before), values_before) << "a snapshot handed out changed";
}

TEST_P(FieldConformance, RefusesUpdatesOutOfOrder) {
  EXPECT_FALSE(GetParam().create(workers_)->update({})) << "an update before attach()";
  attach(grid(20, 20, 20));
  map_->set({3, 4, 5}, true);
  const MapUpdate first = map_->take_update();
  MapUpdate third = first;
  third.sequence = first.sequence + 2;
  ASSERT_TRUE(builder_->update(first));
  for (const MapUpdate& wrong : {first, third}) {
    const auto field = builder_->update(wrong);
    ASSERT_FALSE(field) << "update " << wrong.sequence << " after " << first.sequence;
    EXPECT_EQ(field.error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_TRUE(update());
}

TEST_P(FieldConformance, GradientsAreTheDerivativesOfTheValues) {
  attach(grid(32, 30, 28));
  observe_all(false);
  set_ball(map_->grid().centre_m({16, 15, 14}), 0.2, true);
  const auto field = update();
  ASSERT_TRUE(field);
  const GridSpec& grid = map_->grid();
  std::mt19937 random(5);
  // Inside a cell of the interpolation, away from its faces, where the value has kinks; and in the
  // rim beyond the outermost centres.
  std::uniform_int_distribution<int> cell(-1, 31);
  std::uniform_real_distribution<double> within(0.1, 0.9);
  const double step_m = 1e-4 * grid.resolution_m;
  for (int i = 0; i < 1000; ++i) {
    Eigen::Vector3d p;
    for (int axis = 0; axis < 3; ++axis) {
      const int c = std::min(cell(random), grid.size_vox[axis] - 1);
      p[axis] = grid.origin_m[axis] + (c + 0.5 + within(random)) * grid.resolution_m;
    }
    double value = 0.0;
    Eigen::Vector3d gradient;
    field->query({&p, 1}, {&value, 1}, {&gradient, 1}, {});
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d h = Eigen::Vector3d::Unit(axis) * step_m;
      const double slope = (distance(*field, p + h) - distance(*field, p - h)) / (2.0 * step_m);
      EXPECT_NEAR(gradient[axis], slope, 1e-6) << "at " << p.transpose() << " along " << axis;
    }
  }
}

TEST_P(FieldConformance, TellsKnownUnknownAndOutside) {
  attach(grid(20, 20, 20));
  map_->set({3, 4, 5}, false);
  map_->set({15, 4, 5}, true);
  const auto field = update();
  ASSERT_TRUE(field);
  const GridSpec& grid = map_->grid();
  const double half_m = 0.5 * grid.resolution_m;
  const std::vector<Eigen::Vector3d> points = {
      grid.centre_m({3, 4, 5}),
      grid.centre_m({15, 4, 5}),
      grid.centre_m({8, 8, 8}),
      grid.origin_m - Eigen::Vector3d::Constant(1e-6),
      grid.upper_m() + Eigen::Vector3d(1e-6, -half_m, -half_m),
      Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()),
      Eigen::Vector3d::Constant(1e300),
      Eigen::Vector3d::Constant(-std::numeric_limits<double>::infinity())};
  std::vector<double> distances(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  std::vector<FieldStatus> statuses(points.size());
  field->query(points, distances, gradients, statuses);
  EXPECT_EQ(statuses[0], FieldStatus::kKnown);
  EXPECT_EQ(statuses[1], FieldStatus::kKnown);
  EXPECT_EQ(statuses[2], FieldStatus::kUnknown);
  for (std::size_t i = 3; i < points.size(); ++i)
    EXPECT_EQ(statuses[i], FieldStatus::kOutside) << i;
  for (const Eigen::Vector3d& gradient : gradients) EXPECT_TRUE(gradient.allFinite());
  EXPECT_EQ(field->info().sequence, 1);
  EXPECT_EQ(field->info().stamp, Stamp::from_seconds(1.0));
}

TEST_P(FieldConformance, FindsThePointsBelowTheirLimits) {
  const GridSpec spec = grid(40, 37, 35);
  attach(spec);
  std::mt19937 random(11);
  const auto at_random = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  observe_all(false);
  set_ball(spec.centre_m({13, 15, 14}), 0.3, true);
  for (int i = 0; i < 60; ++i) {
    map_->set({static_cast<int>(random() % 40), static_cast<int>(random() % 37), 30}, true);
  }
  const auto field = update();
  ASSERT_TRUE(field);
  for (const std::size_t n : {std::size_t{16}, std::size_t{1600}}) {
    std::vector<Eigen::Vector3d> points(n);
    for (std::size_t i = 0; i < n; ++i) {
      // Every other sixteen along a path; in single precision, as they are asked for below.
      const bool follows = i % kFloatLanes != 0 && i / kFloatLanes % 2 == 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double margin_m = 2.0 * spec.resolution_m;
        points[i][axis] =
            follows ? points[i - 1][axis] + at_random(-0.02, 0.02)
                    : at_random(spec.origin_m[axis] - margin_m, spec.upper_m()[axis] + margin_m);
        points[i][axis] = static_cast<double>(static_cast<float>(points[i][axis]));
      }
    }
    points[n / 2].x() = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> distances(n);
    std::vector<Eigen::Vector3d> gradients(n);
    std::vector<FieldStatus> statuses(n);
    std::vector<PointFloats> in_lanes(n / kFloatLanes);
    std::vector<double> limits_m;
    for (std::size_t i = 0; i < n; ++i) {
      in_lanes[i / kFloatLanes].x[i % kFloatLanes] = static_cast<float>(points[i].x());
      in_lanes[i / kFloatLanes].y[i % kFloatLanes] = static_cast<float>(points[i].y());
      in_lanes[i / kFloatLanes].z[i % kFloatLanes] = static_cast<float>(points[i].z());
      if (i % kFloatLanes == 0) limits_m.push_back(at_random(-0.1, 0.6));
    }
    field->query(points, distances, gradients, statuses);
    for (const bool also_unknown : {false, true}) {
      std::vector<FieldSample> samples(n);
      samples.resize(field->query_below(in_lanes, limits_m, also_unknown, samples));
      std::size_t next = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const bool listed = statuses[i] == FieldStatus::kOutside ||
                            (also_unknown && statuses[i] == FieldStatus::kUnknown) ||
                            !(distances[i] >= limits_m[i / kFloatLanes]);
        if (!listed) continue;
        ASSERT_LT(next, samples.size()) << "point " << i << " at " << points[i].transpose();
        const FieldSample& sample = samples[next++];
        ASSERT_EQ(sample.point, i);
        EXPECT_EQ(sample.status, statuses[i]);
        if (!std::isnan(distances[i])) {
          EXPECT_EQ(sample.distance_m, distances[i]);
        }
        EXPECT_EQ(sample.gradient, gradients[i]);
      }
      EXPECT_EQ(next, samples.size());
    }
  }
}

TEST_P(FieldConformance, SnapshotsNeverChange) {
  attach(grid(48, 32, 32));
  observe_all(false);
  set_ball(map_->grid().centre_m({10, 10, 10}), 0.2, true);
  const auto before = update();
  ASSERT_TRUE(before);
  const std::vector<double> values = all_values(*before);
  set_ball(map_->grid().centre_m({10, 10, 10}), 0.2, false);
  set_ball(map_->grid().centre_m({30, 20, 15}), 0.3, true);
  const auto after = update();
  ASSERT_TRUE(after);
  EXPECT_EQ(all_values(*before), values);
  EXPECT_NE(all_values(*after), values);
}

TEST_P(FieldConformance, ReadersNeedNoLocks) {
  attach(grid(32, 32, 32));
  observe_all(false);
  map_->set({16, 16, 16}, true);
  const auto pinned = update();
  ASSERT_TRUE(pinned);
  const std::vector<double> values = all_values(*pinned);
  std::atomic<bool> done = false;
  std::atomic<int> mismatches = 0;
  std::thread reader([&] {
    do {
      if (all_values(*pinned) != values) ++mismatches;
    } while (!done);
  });
  for (int i = 0; i < 20; ++i) {
    map_->set({i, 16, 16}, i % 2 == 0);
    EXPECT_TRUE(update());
  }
  done = true;
  reader.join();
  EXPECT_EQ(mismatches, 0);
}

TEST_P(FieldConformance, RefusesAMapperThatDoesNotFit) {
  class Blind final : public Mapper {
   public:
    Result<MapUpdate> integrate(const Frame&) override { return MapUpdate{}; }
    const GridSpec& grid() const noexcept override { return grid_; }

   private:
    GridSpec grid_{Eigen::Vector3d::Zero(), 0.1, Eigen::Vector3i(8, 8, 8)};
  } blind;
  const auto attached = GetParam().create(workers_)->attach(blind);
  ASSERT_FALSE(attached);
  EXPECT_EQ(attached.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(attached.error().message.find("View"), std::string::npos)
      << attached.error().describe();
}

}  // namespace sidestep::conformance
