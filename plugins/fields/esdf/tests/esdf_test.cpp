#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <sidestep/field/dense_field.hpp>

#include "esdf_field.hpp"
#include "sphere_world.hpp"

namespace sidestep::esdf {
namespace {

constexpr double kLimit_m = 0.5;
constexpr double kResolution_m = 0.05;

GridSpec grid() { return {{-0.3, 0.2, 0.1}, kResolution_m, {40, 36, 20}}; }

Options options_of(const std::string& unknown, const std::string& propagation) {
  Options options;
  options.max_distance_m = kLimit_m;
  options.unknown = unknown;
  options.propagation = propagation;
  options.min_change_m = 0.0;
  return options;
}

/// A builder and its newest field.
class Live {
 public:
  Live(const Options& options, Mapper& map, int threads = 2) : workers_(threads) {
    builder_ = make_esdf_builder(options, workers_);
    const auto attached = builder_->attach(map);
    EXPECT_TRUE(attached) << attached.error().describe();
  }
  std::shared_ptr<const DenseField> update(const MapUpdate& update) {
    auto field = builder_->update(update);
    EXPECT_TRUE(field) << field.error().describe();
    return std::dynamic_pointer_cast<const DenseField>(*field);
  }

 private:
  WorkerPool workers_;
  std::unique_ptr<FieldBuilder> builder_;
};

template <class Visit>
void each_voxel(const GridSpec& grid, const Visit& visit) {
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) visit(Eigen::Vector3i(x, y, z));
    }
  }
}

std::vector<float> values(const DenseField& field) {
  std::vector<float> all;
  each_voxel(field.info().grid, [&](const Eigen::Vector3i& v) { all.push_back(field.at(v)); });
  return all;
}

/// Balls that come, move and go, seen a part at a time.
class RandomScene {
 public:
  explicit RandomScene(SphereWorld& world, unsigned seed) : world_(world), random_(seed) {}

  MapUpdate step(double noise_m) {
    auto& balls = world_.balls;
    if (balls.size() < 2 || chance(0.25)) balls.push_back({point(), 0.05 + 0.3 * unit()});
    if (chance(0.5)) balls[below(balls.size())].centre_m = point();
    if (balls.size() > 3 || chance(0.15)) balls.erase(balls.begin());
    if (balls.empty()) balls.push_back({point(), 0.1});
    Eigen::Vector3i low, high;
    for (int axis = 0; axis < 3; ++axis) {
      const auto size = static_cast<std::size_t>(world_.grid().size_vox[axis]);
      const int a = static_cast<int>(below(size));
      const int b = static_cast<int>(below(size));
      low[axis] = std::min(a, b);
      high[axis] = std::max(a, b);
    }
    return world_.look(low, high, noise_m, random_);
  }

 private:
  double unit() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }
  bool chance(double p) { return unit() < p; }
  std::size_t below(std::size_t n) {
    return std::uniform_int_distribution<std::size_t>(0, n - 1)(random_);
  }
  Eigen::Vector3d point() {
    const GridSpec& grid = world_.grid();
    return grid.origin_m + Eigen::Vector3d(unit(), unit(), unit())
                               .cwiseProduct(grid.size_vox.cast<double>() * grid.resolution_m);
  }

  SphereWorld& world_;
  std::mt19937 random_;
};

class EsdfUnknown : public ::testing::TestWithParam<std::string> {};

TEST_P(EsdfUnknown, IncrementsAreTheDefinitionAndABatchBuildBitForBit) {
  SphereWorld world(grid());
  RandomScene scene(world, 11);
  const Options options = options_of(GetParam(), "quasi_euclidean");
  Live live(options, world);
  for (int step = 0; step < 400; ++step) {
    const MapUpdate update = scene.step(step % 3 == 0 ? 0.02 : 0.0);
    const auto field = live.update(update);
    if (step % 4 != 0) continue;
    Live batch(options, world);
    ASSERT_EQ(values(*field), values(*batch.update(update))) << "after step " << step;
    if (step % 16 != 0) continue;
    const RelaxedField definition(world, GetParam(), 2.0 * kResolution_m, kLimit_m);
    each_voxel(grid(), [&](const Eigen::Vector3i& v) {
      ASSERT_EQ(field->at(v), definition.at(v)) << v.transpose() << " after step " << step;
    });
    if (HasFatalFailure()) return;
  }
}

TEST_P(EsdfUnknown, FullEuclideanLiesBetweenStraightLinesAndQuasiEuclidean) {
  SphereWorld world(grid());
  RandomScene scene(world, 12);
  Live live(options_of(GetParam(), "full_euclidean"), world);
  double sum_full = 0.0, sum_quasi = 0.0;
  for (int step = 0; step < 60; ++step) {
    const auto field = live.update(scene.step(0.0));
    if (step % 10 != 9) continue;
    const RelaxedField quasi(world, GetParam(), 2.0 * kResolution_m, kLimit_m);
    int n = 0;
    each_voxel(grid(), [&](const Eigen::Vector3i& v) {
      if (++n % 97 != 0) return;
      const double value = std::abs(static_cast<double>(field->at(v)));
      const double straight = quasi.straight_m(v);
      EXPECT_GE(value, straight - 1e-5) << v.transpose();
      EXPECT_LE(value, std::abs(static_cast<double>(quasi.at(v))) + 1e-5) << v.transpose();
      sum_full += value - straight;
      sum_quasi += std::abs(static_cast<double>(quasi.at(v))) - straight;
    });
  }
  // Straight lines may pass voxels that are ignored, where no wave goes.
  if (GetParam() != "ignored") {
    EXPECT_LT(sum_full, 0.5 * sum_quasi) << "what it is for";
  }
}

TEST_P(EsdfUnknown, SmallChangesLeftOutCostNoMoreThanTheirSize) {
  SphereWorld world(grid());
  RandomScene scene(world, 13);
  Options options = options_of(GetParam(), "quasi_euclidean");
  options.min_change_m = 0.01;
  Live live(options, world);
  Live exact(options_of(GetParam(), "quasi_euclidean"), world);
  for (int step = 0; step < 100; ++step) {
    const MapUpdate update = scene.step(0.008);
    const auto a = values(*live.update(update));
    const auto b = values(*exact.update(update));
    for (std::size_t i = 0; i < a.size(); ++i) ASSERT_NEAR(a[i], b[i], 0.01 + 1e-5) << step;
  }
}

TEST_P(EsdfUnknown, SameOnAnyNumberOfThreads) {
  for (const char* propagation : {"quasi_euclidean", "full_euclidean"}) {
    SphereWorld world(grid());
    RandomScene scene(world, 14);
    Live one(options_of(GetParam(), propagation), world, 1);
    Live many(options_of(GetParam(), propagation), world, 5);
    for (int step = 0; step < 20; ++step) {
      const MapUpdate update = scene.step(0.01);
      ASSERT_EQ(values(*one.update(update)), values(*many.update(update)));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(unknown, EsdfUnknown, ::testing::Values("free", "occupied", "ignored"),
                         [](const auto& test) { return test.param; });

class EsdfPropagation : public ::testing::TestWithParam<std::string> {};

TEST_P(EsdfPropagation, NothingIsLeftOfWhatHasGone) {
  SphereWorld world(grid());
  const Eigen::Vector3d middle = grid().centre_m({20, 18, 10});
  world.balls = {{middle, 0.2}};
  Live live(options_of("free", GetParam()), world);
  const auto with = live.update(world.look_at_all());
  EXPECT_LT(with->at({20, 18, 10}), 0.0F);
  EXPECT_LT(with->at({20, 26, 10}), 0.3F);
  world.balls = {{middle, -10.0}};  // free everywhere
  const auto without = live.update(world.look_at_all());
  for (const float value : values(*without)) {
    ASSERT_FLOAT_EQ(value, static_cast<float>(kLimit_m));
  }
}

TEST_P(EsdfPropagation, BallsDistancesAreThoseOfItsSurface) {
  GridSpec fine = grid();
  fine.size_vox = {50, 50, 50};
  SphereWorld world(fine);
  const Eigen::Vector3d middle = fine.centre_m({25, 25, 25}) + Eigen::Vector3d(0.01, -0.02, 0.005);
  world.balls = {{middle, 0.4}};
  Live live(options_of("free", GetParam()), world);
  const auto field = live.update(world.look_at_all());
  double sum = 0.0, largest = 0.0;
  int n = 0;
  each_voxel(fine, [&](const Eigen::Vector3i& v) {
    const double truth = std::clamp(world.distance_m(fine.centre_m(v)), -kLimit_m, kLimit_m);
    const double error = std::abs(static_cast<double>(field->at(v)) - truth);
    EXPECT_GE(std::abs(static_cast<double>(field->at(v))), std::abs(truth) - 1e-5)
        << "waves only ever overestimate";
    sum += error;
    largest = std::max(largest, error);
    ++n;
  });
  // Voxblox, quasi-Euclidean, on the kitchen: 0.020 m on average, 0.15 m at most.
  EXPECT_LT(sum / n, 0.020);
  EXPECT_LT(largest, GetParam() == "quasi_euclidean" ? 0.1281 * kLimit_m : 0.025);
}

INSTANTIATE_TEST_SUITE_P(propagation, EsdfPropagation,
                         ::testing::Values("quasi_euclidean", "full_euclidean"),
                         [](const auto& test) { return test.param; });

TEST(Esdf, WavesStopAtIgnoredVoxels) {
  SphereWorld world(grid());
  world.balls = {{grid().centre_m({8, 18, 10}), 0.15}};
  Live live(options_of("ignored", "quasi_euclidean"), world);
  std::mt19937 random(1);
  // A layer at x = 14 stays unseen.
  (void)live.update(world.look({0, 0, 0}, {13, 35, 19}, 0.0, random));
  const auto field = live.update(world.look({15, 0, 0}, {39, 35, 19}, 0.0, random));
  EXPECT_LT(field->at({13, 18, 10}), 0.2F);
  EXPECT_FALSE(field->known({14, 18, 10}));
  EXPECT_FLOAT_EQ(field->at({14, 18, 10}), static_cast<float>(kLimit_m));
  EXPECT_FLOAT_EQ(field->at({16, 18, 10}), static_cast<float>(kLimit_m));
}

TEST(Esdf, BlocksOutOfReachAreShared) {
  GridSpec wide = grid();
  wide.size_vox = {96, 32, 16};
  SphereWorld world(wide);
  world.balls = {{wide.centre_m({8, 16, 8}), 0.15}};
  Live live(options_of("free", "quasi_euclidean"), world);
  const auto before = live.update(world.look_at_all());
  world.balls[0].centre_m.x() += 0.1;
  const auto after = live.update(world.look_at_all());
  EXPECT_NE(before->blocks()[0], after->blocks()[0]);
  // The ball reaches 0.65 m beyond its centre: 13 voxels, into the second block.
  for (std::size_t b = 2; b < 6; ++b) EXPECT_EQ(before->blocks()[b], after->blocks()[b]) << b;
}

TEST(Esdf, RefusesABandThatTheTsdfDoesNotHave) {
  SphereWorld world(grid());
  Options options = options_of("free", "quasi_euclidean");
  options.fixed_band_vox = SphereWorld::kTruncation_vox + 0.5;
  WorkerPool workers(1);
  const auto attached = make_esdf_builder(options, workers)->attach(world);
  ASSERT_FALSE(attached);
  EXPECT_EQ(attached.error().code, ErrorCode::kUnsupported);
  EXPECT_NE(attached.error().message.find("fixed_band_vox"), std::string::npos);
}

}  // namespace
}  // namespace sidestep::esdf
