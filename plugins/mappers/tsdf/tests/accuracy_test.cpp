// Zero crossings against surfaces in closed form, and the integrators against each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "support/kinect_kitchen.hpp"
#include "tsdf_testing.hpp"

namespace sidestep::tsdf {
namespace {

using testing_support::BoxWorld;
using testing_support::kinect;
using testing_support::KinectKitchen;
using testing_support::look_at;

class TsdfAccuracy : public ::testing::TestWithParam<std::string> {
 protected:
  /// Where the distance along +x through (y, z) first changes from positive to negative.
  static std::optional<double> surface_x_m(const TsdfProbe& map, double y_m, double z_m) {
    const GridSpec& grid = map.grid();
    Eigen::Vector3i voxel = grid.voxel_at({grid.origin_m.x(), y_m, z_m});
    for (voxel.x() = 0; voxel.x() + 1 < grid.size_vox.x(); ++voxel.x()) {
      const Eigen::Vector3i next = voxel + Eigen::Vector3i::UnitX();
      if (map.weight(voxel) == 0.0F || map.weight(next) == 0.0F) continue;
      const double a = static_cast<double>(map.distance_m(voxel));
      const double b = static_cast<double>(map.distance_m(next));
      if (a > 0.0 && b <= 0.0) {
        return grid.centre_m(voxel).x() + a / (a - b) * grid.resolution_m;
      }
    }
    return std::nullopt;
  }
  /// z of the voxels' centres, so that an expected surface is compared where it is measured.
  static double centre(const TsdfProbe& map, int axis, double p_m) {
    Eigen::Vector3d p = map.grid().origin_m;
    p[axis] = p_m;
    return map.grid().centre_m(map.grid().voxel_at(p))[axis];
  }
};

/// Depth of a sphere; 0 beside it.
Frame sphere_frame(const Eigen::Vector3d& centre_m, double radius_m, const Transform& pose) {
  Frame frame;
  frame.T_world_camera = pose;
  DepthImage image{kinect(320, 240), {}};
  for (int v = 0; v < 240; ++v) {
    for (int u = 0; u < 320; ++u) {
      const Eigen::Vector3d ray = pose.linear() * image.camera.unproject(u, v, 1.0);
      const Eigen::Vector3d to = centre_m - pose.translation();
      const double along = ray.dot(to) / ray.squaredNorm();
      const double inside = radius_m * radius_m - (to - along * ray).squaredNorm();
      const double depth_m = inside > 0.0 ? along - std::sqrt(inside / ray.squaredNorm()) : 0.0;
      image.depth_m.push_back(static_cast<float>(depth_m));
    }
  }
  frame.measurement = std::move(image);
  return frame;
}

TEST_P(TsdfAccuracy, PlaneIsFoundWithinATenthOfAVoxel) {
  for (const double x_m : {2.50, 2.512, 2.531, 2.549}) {
    TsdfProbe map(options_of(GetParam()));
    map.integrate(BoxWorld{{wall_at(x_m)}}.frame(0, kinect(320, 240), eye()));
    for (const double y_m : {-0.6, 0.0, 0.7}) {
      for (const double z_m : {0.6, 1.0, 1.5}) {
        const auto found = surface_x_m(map, y_m, z_m);
        ASSERT_TRUE(found) << y_m << " " << z_m;
        EXPECT_NEAR(*found, x_m, 0.1 * 0.05) << y_m << " " << z_m;
      }
    }
  }
}

TEST_P(TsdfAccuracy, SphereIsFoundWithinHalfAVoxelWhereItFacesTheCamera) {
  const Eigen::Vector3d centre_m(2.3, 0.02, 1.02);
  const double radius_m = 0.5;
  TsdfProbe map(options_of(GetParam()));
  map.integrate(sphere_frame(centre_m, radius_m, eye()));
  for (double y_m = -0.25; y_m <= 0.25; y_m += 0.05) {
    for (double z_m = 0.8; z_m <= 1.25; z_m += 0.05) {
      const double dy = centre(map, 1, y_m) - centre_m.y();
      const double dz = centre(map, 2, z_m) - centre_m.z();
      const double truth = centre_m.x() - std::sqrt(radius_m * radius_m - dy * dy - dz * dz);
      const auto found = surface_x_m(map, y_m, z_m);
      ASSERT_TRUE(found) << y_m << " " << z_m;
      EXPECT_NEAR(*found, truth, 0.5 * 0.05) << y_m << " " << z_m;
    }
  }
}

TEST_P(TsdfAccuracy, BoxIsFoundWhereItFacesTheCamera) {
  TsdfProbe map(options_of(GetParam()));
  const BoxWorld world{{wall_at(4.0), {{2.03, -0.42, 0.61}, {2.6, 0.38, 1.47}}}};
  map.integrate(world.frame(0, kinect(320, 240), eye()));
  for (double y_m = -0.3; y_m <= 0.3; y_m += 0.05) {
    for (double z_m = 0.75; z_m <= 1.35; z_m += 0.05) {
      const auto found = surface_x_m(map, y_m, z_m);
      ASSERT_TRUE(found) << y_m << " " << z_m;
      EXPECT_NEAR(*found, 2.03, 0.1 * 0.05) << y_m << " " << z_m;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(integrators, TsdfAccuracy, ::testing::Values("simple", "merged", "fast"),
                         [](const auto& test) { return test.param; });

struct Agreement {
  double observed = 0.0;  ///< Share of the voxels that simple observes.
  double mean_vox = 0.0;  ///< Mean difference of distances within a voxel of the surface.
};

Agreement with_simple(const TsdfOptions& like, const std::string& integrator,
                      const std::vector<Frame>& frames) {
  TsdfOptions options = like;
  options.integrator = "simple";
  TsdfProbe simple(options);
  options.integrator = integrator;
  TsdfProbe other(options);
  for (const Frame& frame : frames) {
    simple.integrate(frame);
    other.integrate(frame);
  }
  const auto a = simple.copy();
  const auto b = other.copy();
  std::size_t both = 0, seen = 0, compared = 0;
  double difference_m = 0.0;
  for (std::size_t block = 0; block < a.size(); ++block) {
    for (std::size_t v = 0; 2 * v < a[block].size(); ++v) {
      const std::size_t w = v + TsdfBlock::kVoxels;
      if (a[block][w] == 0.0F) continue;
      ++seen;
      if (b[block].empty() || b[block][w] == 0.0F) continue;
      ++both;
      if (std::abs(static_cast<double>(a[block][v])) > options.resolution_m) continue;
      difference_m += static_cast<double>(std::abs(a[block][v] - b[block][v]));
      ++compared;
    }
  }
  return {static_cast<double>(both) / static_cast<double>(seen),
          difference_m / static_cast<double>(compared) / options.resolution_m};
}

TEST(TsdfIntegrators, AgreeOnARoom) {
  const BoxWorld room{
      {{{-1, -9, -1}, {9, 9, 0}}, {{3, -9, 0}, {4, 9, 2}}, {{1.6, -1, 0}, {2.2, 0.3, .7}}}};
  std::vector<Frame> frames;
  for (int f = 0; f < 3; ++f) {
    frames.push_back(
        room.frame(f, kinect(320, 240), look_at({0.5, 0.2 * f, 1.5}, {2.5, 0.1 * f, 0.7})));
  }
  // Points of a voxel differ by less than it; how much is left on average is what is asked here.
  for (const char* integrator : {"merged", "fast"}) {
    const Agreement agreement = with_simple(options_of(""), integrator, frames);
    EXPECT_GT(agreement.observed, 0.8) << integrator;
    EXPECT_LT(agreement.mean_vox, 0.25) << integrator;
  }
}

TEST(TsdfIntegrators, KeepTheKitchensMeasuredPointsAtTheSurface) {
  const KinectKitchen kitchen(SIDESTEP_SHARED_DATA);
  if (!kitchen.present()) GTEST_SKIP() << "no recorded kitchen in " << SIDESTEP_SHARED_DATA;
  const auto frame = kitchen.frame(0);
  ASSERT_TRUE(frame);
  const DepthImage& image = std::get<DepthImage>(frame->measurement);
  for (const char* integrator : {"simple", "merged", "fast"}) {
    TsdfOptions options = options_of(integrator);
    options.size_vox = {160, 160, 64};
    options.origin_m = {-2.0, -4.0, -0.4};
    TsdfProbe map(options);
    const MapUpdate update = map.integrate(*frame);
    EXPECT_GT(update.counts.inserted, 100'000);
    std::vector<double> distances_vox;
    for (int v = 0; v < image.camera.height_px; v += 4) {
      for (int u = 0; u < image.camera.width_px; u += 4) {
        const double depth_m = static_cast<double>(image.at(u, v));
        const Eigen::Vector3d p_camera = image.camera.unproject(u, v, depth_m);
        const Eigen::Vector3d p = frame->T_world_camera * p_camera;
        const Eigen::Vector3i voxel = map.grid().voxel_at(p);
        if (options.rules().fate(p_camera, p) != PointFate::kInsert) continue;
        if (!map.grid().contains(voxel)) continue;
        ASSERT_GT(map.weight(voxel), 0.0F) << integrator;
        distances_vox.push_back(std::abs(static_cast<double>(map.distance_m(voxel))) / 0.05);
      }
    }
    // The centre of a point's voxel is at most half a diagonal from it, and mostly less than half
    // an edge; only rays to what lies behind, past edges, move it farther.
    std::ranges::sort(distances_vox);
    EXPECT_LT(distances_vox[distances_vox.size() / 2], 0.5) << integrator;
  }
}

}  // namespace
}  // namespace sidestep::tsdf
