#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <vector>

#include "conformance/test_host.hpp"
#include "edt_field.hpp"
#include "incremental_field.hpp"
#include "recorded_map.hpp"
#include "support/benchmark_frames.hpp"
#include "voxel_grid.hpp"

// One update of the field after each of 99 frames, on one thread, publication included, on the map
// that voxel_grid makes of every third frame of a real kitchen; of a rendered room where those
// frames are absent. The first field, a full transform, is not counted. Times are those of the
// thread, so that other processes do not count.
namespace {

using namespace sidestep;
using conformance::TestHost;
using incremental::RecordedMap;
using testing_support::KitchenOrRoom;

constexpr int kFrames = 100;

double thread_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// The map at a resolution, recorded when it is first asked for.
RecordedMap& recorded_map(std::int64_t resolution_mm) {
  static std::map<std::int64_t, RecordedMap> maps;
  if (const auto known = maps.find(resolution_mm); known != maps.end()) return known->second;
  voxel_grid::VoxelGridOptions options;
  options.resolution_m = 0.001 * static_cast<double>(resolution_mm);
  options.size_vox =
      (Eigen::Vector3d(8.0, 8.0, 3.2) / options.resolution_m).array().round().cast<int>();
  options.origin_m = {-2.0, -4.0, -0.1};
  TestHost host(2);
  const auto mapper = *voxel_grid::create(options, host.context());
  RecordedMap& map = maps.emplace(resolution_mm, mapper->grid()).first->second;
  const KitchenOrRoom frames(SIDESTEP_SHARED_DATA);
  for (int n = 0; n < kFrames; ++n) {
    map.record(*mapper->integrate(frames.frame(3 * n)),
               dynamic_cast<const OccupancyView&>(*mapper));
  }
  return map;
}

using MakeBuilder = std::unique_ptr<FieldBuilder> (*)(bool is_signed, WorkerPool& workers);

std::unique_ptr<FieldBuilder> make_edt(bool is_signed, WorkerPool& workers) {
  return edt::make_edt_builder({is_signed, 0.8, "free"}, workers);
}
template <int kConnectivity>
std::unique_ptr<FieldBuilder> make_incremental(bool is_signed, WorkerPool& workers) {
  return incremental::make_incremental_builder(
      {is_signed, 0.8, "free", std::to_string(kConnectivity)}, workers);
}

void kitchen(benchmark::State& state, MakeBuilder make) {
  RecordedMap& map = recorded_map(state.range(0));
  WorkerPool workers(1);
  std::unique_ptr<FieldBuilder> builder;
  std::vector<double> times_ms;
  for (auto _ : state) {
    if (builder == nullptr || map.at_end()) {
      map.rewind();
      builder = make(state.range(1) != 0, workers);
      if (!builder->attach(map) || !builder->update(map.step())) {
        state.SkipWithError("no first field");
        return;
      }
    }
    const MapUpdate& update = map.step();
    const double start_ms = thread_ms();
    const auto field = builder->update(update);
    times_ms.push_back(thread_ms() - start_ms);
    state.SetIterationTime(times_ms.back() * 1e-3);
  }
  std::ranges::sort(times_ms);
  const auto share = [&](double s) {
    return times_ms[static_cast<std::size_t>(s * static_cast<double>(times_ms.size() - 1))];
  };
  state.counters["p50_ms"] = share(0.5);
  state.counters["p95_ms"] = share(0.95);
  state.counters["max_ms"] = share(1.0);
}

void arguments(benchmark::internal::Benchmark* benchmark) {
  benchmark->ArgNames({"mm", "signed"})
      ->ArgsProduct({{25, 50, 100}, {0, 1}})
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
}
BENCHMARK_CAPTURE(kitchen, incremental_24, &make_incremental<24>)->Apply(arguments);
BENCHMARK_CAPTURE(kitchen, incremental_26, &make_incremental<26>)->Apply(arguments);
BENCHMARK_CAPTURE(kitchen, edt, &make_edt)->Apply(arguments);

}  // namespace
