#include <benchmark/benchmark.h>

#include <array>
#include <vector>

#include "support/box_world.hpp"
#include "support/kinect_kitchen.hpp"
#include "support/test_host.hpp"
#include "tsdf_mapper.hpp"

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

void integrate(benchmark::State& state, const char* integrator) {
  tsdf::TsdfOptions options;
  const double scale = static_cast<double>(state.range(0)) / 25.0;
  options.resolution_m = 0.025 * scale;
  options.size_vox = (Eigen::Vector3d(320, 320, 128) / scale).cast<int>();
  options.origin_m = {-2.0, -4.0, -0.4};
  options.integrator = integrator;
  TestHost host(static_cast<int>(state.range(1)));
  auto mapper = tsdf::create(options, host.context());
  const std::vector<Frame> input = frames();
  std::size_t next = 0;
  for (auto _ : state) {
    auto update = (*mapper)->integrate(input[next]);
    benchmark::DoNotOptimize(update);
    next = (next + 1) % input.size();
  }
}

void all_sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"mm", "threads"})
      ->ArgsProduct({{25, 50, 100}, {1, 2}})
      ->Unit(benchmark::kMillisecond)
      ->MeasureProcessCPUTime()
      ->UseRealTime();
}
BENCHMARK_CAPTURE(integrate, fast, "fast")->Apply(all_sizes);
BENCHMARK_CAPTURE(integrate, merged, "merged")->Apply(all_sizes);
BENCHMARK_CAPTURE(integrate, simple, "simple")->Apply(all_sizes);

}  // namespace
