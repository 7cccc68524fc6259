#include <benchmark/benchmark.h>

#include "../tests/octree_map.hpp"
#include "dynamic_edt_field.hpp"
#include "edt_field.hpp"
#include "support/furnished_room.hpp"

// dynamicEDT3D and the exact transform side by side, on the same map, at 0.05 m.
namespace {

using namespace sidestep;
using conformance::OctreeMap;
using testing_support::FurnishedRoom;

constexpr double kResolution_m = 0.05;

std::unique_ptr<FieldBuilder> create(bool exact, Mapper& map, WorkerPool& workers) {
  auto builder = exact ? edt::make_edt_builder({false, 0.8, "free"}, workers)
                       : dynamic_edt::make_dynamic_edt_builder({0.8, "free"}, workers);
  return builder->attach(map) ? std::move(builder) : nullptr;
}

void full(benchmark::State& state, bool exact) {
  OctreeMap map(FurnishedRoom::grid(kResolution_m));
  WorkerPool workers(1);
  FurnishedRoom::furnish(map);
  const MapUpdate update = map.take_update();
  for (auto _ : state) {
    state.PauseTiming();
    map.octree().resetChangeDetection();
    auto builder = create(exact, map, workers);
    state.ResumeTiming();
    auto field = builder->update(update);
    benchmark::DoNotOptimize(field);
  }
}
BENCHMARK_CAPTURE(full, dynamic_edt, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(full, edt, true)->Unit(benchmark::kMillisecond);

void walker(benchmark::State& state, bool exact) {
  OctreeMap map(FurnishedRoom::grid(kResolution_m));
  WorkerPool workers(1);
  FurnishedRoom::furnish(map);
  auto builder = create(exact, map, workers);
  auto field = builder->update(map.take_update());
  int step = 0;
  const auto x_m = [&] { return 3.0 + 0.1 * (step % 20); };
  for (auto _ : state) {
    state.PauseTiming();
    map.octree().resetChangeDetection();
    FurnishedRoom::set_walker(map, x_m(), false);
    ++step;
    FurnishedRoom::set_walker(map, x_m(), true);
    const MapUpdate update = map.take_update();
    state.ResumeTiming();
    field = builder->update(update);
    benchmark::DoNotOptimize(field);
  }
}
BENCHMARK_CAPTURE(walker, dynamic_edt, false)->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(walker, edt, true)->Unit(benchmark::kMillisecond);

}  // namespace
