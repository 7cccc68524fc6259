#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <string>
#include <vector>

#include <sidestep/planning/prediction.hpp>

#include "people_world.hpp"

namespace sidestep {
namespace {

using testing_support::PeopleMap;
using testing_support::PeopleWorld;
using testing_support::Walk;

/// Ten people walk about in view of the camera at 1.2 m/s, up and down lanes: two in each, one on
/// the left and one on the right.
std::vector<Walk> ten_people() {
  std::vector<Walk> walks;
  for (int i = 0; i < 10; ++i) {
    const double x_m = 1.9 + 0.58 * (i / 2), far_m = 0.5 * x_m, near_m = 0.3;
    const double side = i % 2 == 0 ? 1.0 : -1.0, way_m = std::max(0.4, far_m - near_m);
    Walk walk;
    for (int turn = 0; turn < 40; ++turn) {
      const double y_m = (turn + i / 2) % 2 == 0 ? near_m : near_m + way_m;
      walk.places.push_back({turn * way_m / 1.2, x_m, side * y_m});
    }
    walks.push_back(std::move(walk));
  }
  return walks;
}

/// Of this thread alone: what else the machine does is not counted.
double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// Of each map.
struct Costs {
  std::vector<double> detect_ms, track_ms, mask_ms, predict_ms, sum_ms;
};

/// What ten people cost a map, part by part: p50 and p95 of 100 maps. The detector's look(), which
/// loops without tracks have, too, is not in the sum. Arguments: the edge of a voxel [mm], every
/// which of the camera's pixels there is, frames a second.
void BM_TenPeople(benchmark::State& state) {
  PeopleWorld world(ten_people(), {}, static_cast<int>(state.range(1)));
  PeopleMap map(1e-3 * static_cast<double>(state.range(0)));
  MaskedOccupancy masked(map.map(), map.map());
  Costs costs;
  double tracks = 0.0;
  int number = 0;
  for (auto _ : state) {
    const Frame frame = world.look(number++, 1.0 / static_cast<double>(state.range(2)));
    MapUpdate update = map.integrate(frame);
    double begin = cpu_ms();
    const auto moving = map.detector().look(map.map(), frame.stamp);
    costs.detect_ms.push_back(cpu_ms() - begin);
    begin = cpu_ms();
    const auto tracked = map.tracker.update(map.map(), *moving, frame);
    costs.track_ms.push_back(cpu_ms() - begin);
    begin = cpu_ms();
    masked.apply(map.tracker.mask(), update);
    costs.mask_ms.push_back(cpu_ms() - begin);
    begin = cpu_ms();
    const auto prediction = worst_case_prediction(*tracked, 1.6, 6.0);
    costs.predict_ms.push_back(cpu_ms() - begin);
    benchmark::DoNotOptimize(prediction);
    costs.sum_ms.push_back(costs.track_ms.back() + costs.mask_ms.back() + costs.predict_ms.back());
    state.SetIterationTime(1e-3 * costs.sum_ms.back());
    tracks += static_cast<double>(tracked->tracks.size());
    map.detector().remember(map.map(), frame.T_world_camera.translation(), frame.stamp);
  }
  const auto add = [&](const std::string& name, std::vector<double>& values) {
    std::ranges::sort(values);
    state.counters[name + "_p50_ms"] = values[values.size() / 2];
    state.counters[name + "_p95_ms"] = values[values.size() * 19 / 20];
  };
  add("detect", costs.detect_ms);
  add("track", costs.track_ms);
  add("mask", costs.mask_ms);
  add("predict", costs.predict_ms);
  add("sum", costs.sum_ms);
  state.counters["tracks"] = tracks / static_cast<double>(number);
}
BENCHMARK(BM_TenPeople)
    ->Args({50, 4, 10})
    ->Args({25, 1, 30})
    ->Iterations(100)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace sidestep
