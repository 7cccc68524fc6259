#include <benchmark/benchmark.h>

#include <vector>

#include "conformance/test_host.hpp"
#include "support/benchmark_frames.hpp"
#include "voxel_grid.hpp"

namespace {

using namespace sidestep;
using conformance::TestHost;
using testing_support::KitchenOrRoom;

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

void projective(benchmark::State& state) {
  integrate(state, KitchenOrRoom(SIDESTEP_SHARED_DATA).ten_frames());
}
BENCHMARK(projective)
    ->ArgNames({"mm", "threads"})
    ->ArgsProduct({{25, 50, 100}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void raycast(benchmark::State& state) {
  std::vector<Frame> clouds;
  for (const Frame& frame : KitchenOrRoom(SIDESTEP_SHARED_DATA).ten_frames())
    clouds.push_back(as_cloud(frame));
  integrate(state, std::move(clouds));
}
BENCHMARK(raycast)
    ->ArgNames({"mm", "threads"})
    ->ArgsProduct({{25, 50}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
