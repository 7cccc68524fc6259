#include <benchmark/benchmark.h>

#include <vector>

#include "support/box_world.hpp"
#include "support/kinect_kitchen.hpp"
#include "support/test_host.hpp"
#include "voxel_grid.hpp"

namespace {

using namespace sidestep;
using namespace sidestep::testing_support;

/// Real frames where they are present, otherwise a rendered room of the same size.
std::vector<Frame> frames() {
  std::vector<Frame> all;
  const KinectKitchen kitchen(SIDESTEP_SHARED_DATA);
  for (int n = 0; n < 300; n += 30) {
    if (auto frame = kitchen.present() ? kitchen.frame(n) : std::nullopt) all.push_back(*frame);
  }
  if (!all.empty()) return all;
  const BoxWorld room{
      {{{-1, -9, -1}, {9, 9, 0}}, {{3, -9, 0}, {4, 9, 2}}, {{1, -1, 0}, {2, 1, .7}}}};
  all.push_back(room.frame(0, kinect(640, 480), look_at({0, 0, 1.5}, {2, 0, 0.7})));
  return all;
}

Frame as_cloud(Frame frame) {
  const DepthImage image = std::get<DepthImage>(frame.measurement);
  PointCloud cloud;
  for (int v = 0; v < image.camera.height_px; ++v) {
    for (int u = 0; u < image.camera.width_px; ++u) {
      if (image.at(u, v) <= 0.0F) continue;
      cloud.points_m.push_back(
          image.camera.unproject(u, v, static_cast<double>(image.at(u, v))).cast<float>());
    }
  }
  frame.measurement = std::move(cloud);
  return frame;
}

void integrate(benchmark::State& state, std::vector<Frame> input) {
  voxel_grid::VoxelGridOptions options;
  const double scale = static_cast<double>(state.range(0)) / 25.0;
  options.resolution_m = 0.025 * scale;
  options.size_vox = (Eigen::Vector3d(320, 320, 128) / scale).cast<int>();
  options.origin_m = {-2.0, -4.0, -0.4};
  TestHost host(static_cast<int>(state.range(1)));
  auto mapper = voxel_grid::create(options, host.context());
  std::size_t next = 0;
  for (auto _ : state) {
    auto update = (*mapper)->integrate(input[next]);
    benchmark::DoNotOptimize(update);
    next = (next + 1) % input.size();
  }
}

void projective(benchmark::State& state) { integrate(state, frames()); }
BENCHMARK(projective)
    ->ArgNames({"mm", "threads"})
    ->ArgsProduct({{25, 50, 100}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void raycast(benchmark::State& state) {
  std::vector<Frame> clouds;
  for (const Frame& frame : frames()) clouds.push_back(as_cloud(frame));
  integrate(state, std::move(clouds));
}
BENCHMARK(raycast)
    ->ArgNames({"mm", "threads"})
    ->ArgsProduct({{25, 50}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
