#include <benchmark/benchmark.h>

#include <string>

#include "conformance/test_host.hpp"
#include "esdf_field.hpp"
#include "support/benchmark_frames.hpp"
#include "tsdf_mapper.hpp"

namespace {

using namespace sidestep;
using conformance::TestHost;
using testing_support::KitchenOrRoom;

/// Every third of the kitchen's.
constexpr int kFrames = 100;

/// The field after each frame of the fast integrator, whose own time is not counted. Its mean
/// over the sequence is that of a run of some hundreds of iterations.
void update(benchmark::State& state, const std::string& propagation, const std::string& unknown) {
  tsdf::TsdfOptions map_options;
  const double scale = static_cast<double>(state.range(0)) / 25.0;
  map_options.resolution_m = 0.025 * scale;
  map_options.size_vox = (Eigen::Vector3d(320, 320, 128) / scale).cast<int>();
  map_options.origin_m = {-2.0, -4.0, -0.4};
  TestHost host(static_cast<int>(state.range(1)));
  esdf::Options options;
  options.unknown = unknown;
  options.propagation = propagation;
  const KitchenOrRoom frames(SIDESTEP_SHARED_DATA);
  std::unique_ptr<tsdf::TsdfMapper> mapper;
  std::unique_ptr<FieldBuilder> builder;
  Result<std::shared_ptr<const DistanceField>> field;
  int next = 0;
  for (auto _ : state) {
    state.PauseTiming();
    if (next == 0) {  // a map that has seen everything before would change too little
      mapper = std::make_unique<tsdf::TsdfMapper>(map_options, host.context());
      builder = esdf::make_esdf_builder(options, host.workers());
      if (!builder->attach(*mapper)) state.SkipWithError("attach failed");
    }
    const auto change = mapper->integrate(frames.frame(3 * next));
    next = (next + 1) % kFrames;
    state.ResumeTiming();
    field = builder->update(*change);
    benchmark::DoNotOptimize(field);
  }
}

void all_sizes(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"mm", "threads"})
      ->ArgsProduct({{25, 50, 100}, {1, 2}})
      ->Unit(benchmark::kMillisecond)
      ->MeasureProcessCPUTime()
      ->UseRealTime();
}
BENCHMARK_CAPTURE(update, quasi_ignored, "quasi_euclidean", "ignored")->Apply(all_sizes);
BENCHMARK_CAPTURE(update, quasi_free, "quasi_euclidean", "free")->Apply(all_sizes);
BENCHMARK_CAPTURE(update, full_ignored, "full_euclidean", "ignored")->Apply(all_sizes);

}  // namespace
