#include <benchmark/benchmark.h>

#include <array>
#include <vector>

#include "conformance/test_host.hpp"
#include "support/benchmark_frames.hpp"
#include "tsdf_mapper.hpp"

namespace {

using namespace sidestep;
using conformance::TestHost;
using testing_support::KitchenOrRoom;

void integrate(benchmark::State& state, const char* integrator) {
  tsdf::TsdfOptions options;
  const double scale = static_cast<double>(state.range(0)) / 25.0;
  options.resolution_m = 0.025 * scale;
  options.size_vox = (Eigen::Vector3d(320, 320, 128) / scale).cast<int>();
  options.origin_m = {-2.0, -4.0, -0.4};
  options.integrator = integrator;
  TestHost host(static_cast<int>(state.range(1)));
  auto mapper = tsdf::create(options, host.context());
  const std::vector<Frame> input = KitchenOrRoom(SIDESTEP_SHARED_DATA).ten_frames();
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
