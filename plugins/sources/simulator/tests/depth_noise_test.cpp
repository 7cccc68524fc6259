#include "../depth_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

namespace sidestep::simulator {
namespace {

constexpr int kWidth = 200;
constexpr int kHeight = 150;
constexpr CameraIntrinsics kCamera{kWidth, kHeight, 554.38, 554.38, 99.5, 74.5};
constexpr Range kRange{0.4, 5.0};

ExactImage flat(float depth_m, double incidence_rad = 0.0) {
  const std::size_t pixels = std::size_t{kWidth} * kHeight;
  return {std::vector<float>(pixels, depth_m),
          std::vector<float>(pixels, static_cast<float>(std::cos(incidence_rad)))};
}

NoiseOptions quiet_kinect() {
  NoiseOptions noise;
  noise.model = "kinect";
  noise.axial_scale = 0.0;
  noise.lateral_sigma_px = 0.0;
  noise.disparity_step_px = 0.0;
  noise.edge_dropout = 0.0;
  noise.random_dropout = 0.0;
  return noise;
}

std::vector<float> measured(const NoiseOptions& noise, const ExactImage& exact,
                            std::uint64_t seed = 1, std::int64_t frame = 0, int threads = 1) {
  WorkerPool workers(threads);
  std::vector<float> depth_m;
  DepthSensor(kCamera, kRange, noise, seed).measure(exact, frame, workers, depth_m);
  return depth_m;
}

double share_of_nothing(const std::vector<float>& depth_m) {
  return static_cast<double>(std::ranges::count(depth_m, 0.0F)) /
         static_cast<double>(depth_m.size());
}

TEST(DepthSensor, WithoutNoiseOnlyCutsAtTheRange) {
  ExactImage exact = flat(2.0F);
  exact.depth_m[0] = 0.39F;
  exact.depth_m[1] = 5.01F;
  exact.depth_m[2] = std::numeric_limits<float>::infinity();
  exact.depth_m[3] = 0.41F;
  for (const NoiseOptions& noise : {NoiseOptions(), quiet_kinect()}) {
    const auto depth_m = measured(noise, exact);
    EXPECT_EQ(depth_m[0], 0.0F);
    EXPECT_EQ(depth_m[1], 0.0F);
    EXPECT_EQ(depth_m[2], 0.0F);
    EXPECT_EQ(depth_m[3], 0.41F);
    EXPECT_EQ(depth_m[4], 2.0F);
  }
}

TEST(DepthSensor, AxialNoiseHasThePublishedSpread) {
  // Nguyen et al.: 1.2 mm at 0.4 m, and 0.0012 + 0.0019 (3 - 0.4)^2 = 14 mm at 3 m.
  NoiseOptions noise = quiet_kinect();
  noise.axial_scale = 1.0;
  for (const auto& [depth_m, sigma_m] : {std::pair{0.5, 0.001219}, std::pair{3.0, 0.014044}}) {
    const auto values = measured(noise, flat(static_cast<float>(depth_m)));
    double sum = 0.0;
    double squares = 0.0;
    for (const float value : values) {
      sum += value - depth_m;
      squares += (value - depth_m) * (value - depth_m);
    }
    const auto count = static_cast<double>(values.size());
    EXPECT_NEAR(sum / count, 0.0, 5.0 * sigma_m / std::sqrt(count));
    EXPECT_NEAR(std::sqrt(squares / count), sigma_m, 0.02 * sigma_m);
  }
}

TEST(DepthSensor, SigmaGrowsTowardsGrazingAndStaysFinite) {
  EXPECT_DOUBLE_EQ(kinect_axial_sigma_m(2.0, 0.0), kinect_axial_sigma_m(2.0, 1.0));
  const double ratio = 1.2 / (std::numbers::pi / 2 - 1.2);
  EXPECT_NEAR(kinect_axial_sigma_m(1.0, 1.2), 0.0012 + 0.0019 * 0.36 + 0.0001 * ratio * ratio,
              1e-12);
  EXPECT_TRUE(std::isfinite(kinect_axial_sigma_m(1.0, std::numbers::pi / 2)));
  EXPECT_DOUBLE_EQ(kinect_lateral_growth(0.0), 1.0);
  EXPECT_TRUE(std::isfinite(kinect_lateral_growth(std::numbers::pi / 2)));
}

TEST(DepthSensor, RoundsToStepsOfDisparity) {
  NoiseOptions noise = quiet_kinect();
  noise.axial_scale = 1.0;
  noise.disparity_step_px = 0.125;
  const auto values = measured(noise, flat(3.0F));
  std::set<float> levels(values.begin(), values.end());
  EXPECT_LT(levels.size(), 12U);
  for (const float level : levels) {
    const double disparity_px = 554.38 * 0.075 / level;
    EXPECT_NEAR(disparity_px / 0.125, std::round(disparity_px / 0.125), 1e-3);
  }
}

TEST(DepthSensor, LateralNoiseMovesEdgesButNeverInventsDepths) {
  NoiseOptions noise = quiet_kinect();
  noise.lateral_sigma_px = 0.8;
  ExactImage exact = flat(1.0F);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = kWidth / 2; u < kWidth; ++u) {
      exact.depth_m[static_cast<std::size_t>(v * kWidth + u)] = 3.0F;
    }
  }
  const auto values = measured(noise, exact);
  int swapped = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    EXPECT_TRUE(values[i] == 1.0F || values[i] == 3.0F);
    if (values[i] == exact.depth_m[i]) continue;
    ++swapped;
    const int u = static_cast<int>(i) % kWidth;
    EXPECT_NEAR(u, kWidth / 2 - 0.5, 5.0);
  }
  EXPECT_GT(swapped, kHeight / 4);
}

TEST(DepthSensor, DropsEdgesGrazingSurfacesAndAShareAtRandom) {
  NoiseOptions noise = quiet_kinect();
  noise.random_dropout = 0.1;
  EXPECT_NEAR(share_of_nothing(measured(noise, flat(2.0F))), 0.1, 0.01);

  noise = quiet_kinect();
  EXPECT_EQ(share_of_nothing(measured(noise, flat(2.0F, 1.39))), 0.0);
  EXPECT_EQ(share_of_nothing(measured(noise, flat(2.0F, 1.41))), 1.0);

  noise.edge_dropout = 0.5;
  ExactImage edge = flat(2.0F);
  for (int v = 0; v < kHeight; ++v) edge.depth_m[static_cast<std::size_t>(v * kWidth + 7)] = 2.5F;
  // The column itself and its two neighbours.
  EXPECT_NEAR(share_of_nothing(measured(noise, edge)) * kWidth, 1.5, 0.3);
  EXPECT_EQ(share_of_nothing(measured(noise, flat(2.0F))), 0.0);
}

TEST(DepthSensor, IsDeterminedBySeedAndFrameWhateverTheThreads) {
  NoiseOptions noise;
  noise.model = "kinect";
  const ExactImage exact = flat(2.0F, 0.3);
  const auto values = measured(noise, exact, 42, 3, 1);
  EXPECT_EQ(values, measured(noise, exact, 42, 3, 2));
  EXPECT_NE(values, measured(noise, exact, 43, 3, 1));
  EXPECT_NE(values, measured(noise, exact, 42, 4, 1));
}

}  // namespace
}  // namespace sidestep::simulator
