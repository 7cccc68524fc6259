#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <sidestep/core/time.hpp>
#include <sidestep/field/dense_field.hpp>

#include "conformance/test_host.hpp"
#include "edt_field.hpp"
#include "full_transform.hpp"
#include "support/furnished_room.hpp"
#include "support/kinect_kitchen.hpp"
#include "voxel_grid.hpp"

namespace {

using namespace sidestep;
using conformance::GridMap;
using testing_support::FurnishedRoom;

constexpr double kLimit_m = 0.8;

edt::Options options(bool is_signed, bool truncated) {
  return {is_signed, truncated ? kLimit_m : 0.0, "free"};
}

std::vector<std::int32_t> all_blocks(const GridSpec& grid) {
  std::vector<std::int32_t> blocks(static_cast<std::size_t>(block_counts(grid).prod()));
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b] = static_cast<std::int32_t>(b);
  return blocks;
}

/// The first field of a map: every voxel, nothing kept from before, and all memory new.
void first(benchmark::State& state) {
  GridMap map(FurnishedRoom::grid(0.025));
  WorkerPool workers(static_cast<int>(state.range(2)));
  FurnishedRoom::furnish(map);
  MapUpdate update = map.take_update();
  update.changed_blocks = all_blocks(map.grid());
  const auto create = [&] {
    auto builder =
        edt::make_edt_builder(options(state.range(0) != 0, state.range(1) != 0), workers);
    if (!builder->attach(map)) state.SkipWithError("attach failed");
    return builder;
  };
  auto builder = create();
  for (auto _ : state) {
    auto field = builder->update(update);
    benchmark::DoNotOptimize(field);
    state.PauseTiming();
    field->reset();
    builder = create();
    state.ResumeTiming();
  }
}
BENCHMARK(first)
    ->ArgNames({"signed", "truncated", "threads"})
    ->ArgsProduct({{0, 1}, {0, 1}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// Every voxel anew, without a limit, into floats.
void transform_all(benchmark::State& state, const GridSpec& grid, const VoxelBits& obstacles,
                   int threads) {
  WorkerPool workers(threads);
  std::vector<float> metres(static_cast<std::size_t>(grid.size_vox.squaredNorm()) + 1);
  for (std::size_t d2 = 0; d2 < metres.size(); ++d2) {
    metres[d2] = static_cast<float>(grid.resolution_m * std::sqrt(static_cast<double>(d2)));
  }
  edt::FullTransform transform(grid.size_vox, metres, workers);
  transform.update(obstacles);  // touches its memory
  for (auto _ : state) {
    transform.update(obstacles);
    benchmark::DoNotOptimize(transform.row(0, 0));
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(grid.voxel_count()));
}

/// The room in a grid of `side` x `side` x `height`.
void full_room(benchmark::State& state) {
  GridSpec grid = FurnishedRoom::grid(0.025);
  grid.size_vox = {static_cast<int>(state.range(0)), static_cast<int>(state.range(0)),
                   static_cast<int>(state.range(1))};
  GridMap map(grid);
  FurnishedRoom::furnish(map);
  transform_all(state, grid, map.occupied(), static_cast<int>(state.range(2)));
}
BENCHMARK(full_room)
    ->ArgNames({"side", "height", "threads"})
    ->Args({320, 128, 1})
    ->Args({320, 128, 2})
    ->Args({704, 128, 2})
    ->Args({1024, 256, 2})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// One voxel in `one_in` is an obstacle, anywhere: no row or slice to skip, and neighbours whose
/// nearest obstacles lie far apart.
void full_scattered(benchmark::State& state) {
  const GridSpec grid = FurnishedRoom::grid(0.025);
  GridMap map(grid);
  std::mt19937 random(4);
  for (std::size_t i = 0; i < grid.voxel_count() / static_cast<std::size_t>(state.range(0)); ++i) {
    Eigen::Vector3i voxel;
    for (int axis = 0; axis < 3; ++axis) {
      voxel[axis] = std::uniform_int_distribution<int>(0, grid.size_vox[axis] - 1)(random);
    }
    map.set(voxel, true);
  }
  transform_all(state, grid, map.occupied(), 2);
}
BENCHMARK(full_scattered)
    ->ArgName("one_in")
    ->RangeMultiplier(10)
    ->Range(10, 1000000)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// The recorded kitchen, after all its frames.
void full_kitchen(benchmark::State& state) {
  const testing_support::KinectKitchen recording(SIDESTEP_SHARED_DATA);
  if (!recording.present()) return state.SkipWithError("the recorded kitchen is not there");
  conformance::TestHost host(2);
  voxel_grid::VoxelGridOptions mapping;
  mapping.origin_m = {-2.0, -4.0, -0.1};
  voxel_grid::VoxelGrid map(mapping, host.context());
  for (int i = 0; i < 300; ++i) (void)map.integrate(recording.frame(i).value());
  transform_all(state, map.grid(), map.occupied(), static_cast<int>(state.range(0)));
}
BENCHMARK(full_kitchen)
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// A person-sized box takes a step of four voxels in the room.
void walker(benchmark::State& state) {
  GridMap map(FurnishedRoom::grid(0.025));
  WorkerPool workers(static_cast<int>(state.range(2)));
  FurnishedRoom::furnish(map);
  auto builder = edt::make_edt_builder(options(state.range(0) != 0, state.range(1) != 0), workers);
  if (!builder->attach(map)) state.SkipWithError("attach failed");
  int step = 0;
  const auto x_m = [&] { return 3.0 + 0.1 * (step % 20); };
  FurnishedRoom::set_walker(map, x_m(), true);
  auto field = builder->update(map.take_update());
  for (auto _ : state) {
    state.PauseTiming();
    FurnishedRoom::set_walker(map, x_m(), false);
    ++step;
    FurnishedRoom::set_walker(map, x_m(), true);
    const MapUpdate update = map.take_update();
    state.ResumeTiming();
    field = builder->update(update);
    benchmark::DoNotOptimize(field);
  }
}
BENCHMARK(walker)
    ->ArgNames({"signed", "truncated", "threads"})
    ->ArgsProduct({{0, 1}, {0, 1}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

double quantile(std::vector<double> values, double q) {
  std::ranges::sort(values);
  return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

/// Frames of the recorded kitchen through mapper and field, from the frame in hand to the published
/// field. Counts the times of single frames, and what they changed.
void map_kitchen(benchmark::State& state, const GridSpec& grid, bool is_signed, int threads) {
  const testing_support::KinectKitchen recording(SIDESTEP_SHARED_DATA);
  if (!recording.present()) return state.SkipWithError("the recorded kitchen is not there");
  conformance::TestHost host(threads);
  voxel_grid::VoxelGridOptions mapping;
  mapping.resolution_m = grid.resolution_m;
  mapping.size_vox = grid.size_vox;
  mapping.origin_m = grid.origin_m;
  voxel_grid::VoxelGrid map(mapping, host.context());
  const auto builder = edt::make_edt_builder(options(is_signed, true), host.workers());
  if (!builder->attach(map)) state.SkipWithError("attach failed");
  constexpr int kFrames = 300;
  std::vector<Frame> frames;
  for (int i = 0; i < kFrames; ++i) frames.push_back(recording.frame(i).value());
  std::vector<double> integrate_ms, update_ms, total_ms;
  std::size_t changed_blocks = 0;
  std::shared_ptr<const DistanceField> field;
  for (auto _ : state) {
    for (const Frame& frame : frames) {
      Stopwatch watch;
      const MapUpdate update = map.integrate(frame).value();
      integrate_ms.push_back(watch.elapsed_ms());
      changed_blocks += update.changed_blocks.size();
      watch.restart();
      field = builder->update(update).value();
      update_ms.push_back(watch.elapsed_ms());
      total_ms.push_back(integrate_ms.back() + update_ms.back());
    }
  }
  state.counters["integrate_p50_ms"] = quantile(integrate_ms, 0.5);
  state.counters["field_p50_ms"] = quantile(update_ms, 0.5);
  state.counters["p50_ms"] = quantile(total_ms, 0.5);
  state.counters["p95_ms"] = quantile(total_ms, 0.95);
  state.counters["first_ms"] = total_ms.front();
  state.counters["blocks"] =
      static_cast<double>(changed_blocks) / static_cast<double>(total_ms.size());
}

/// Resolutions of the same volume.
void kitchen(benchmark::State& state) {
  const int mm = static_cast<int>(state.range(0));
  map_kitchen(state, {{-2.0, -4.0, -0.1}, mm / 1000.0, Eigen::Vector3i(320, 320, 128) * 25 / mm},
              state.range(1) != 0, static_cast<int>(state.range(2)));
}
BENCHMARK(kitchen)
    ->ArgNames({"mm", "signed", "threads"})
    ->ArgsProduct({{25, 50, 100}, {0, 1}, {1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// Volumes at 2.5 cm around the same kitchen, of which the camera sees the same part.
void kitchen_in_a_grid_of(benchmark::State& state) {
  const int side = static_cast<int>(state.range(0));
  const int height = static_cast<int>(state.range(1));
  const double before_m = 0.0125 * (side - 320);  // the grid of kitchen() in the middle
  map_kitchen(state, {{-2.0 - before_m, -4.0 - before_m, -0.1}, 0.025, {side, side, height}}, false,
              2);
}
BENCHMARK(kitchen_in_a_grid_of)
    ->ArgNames({"side", "height"})
    ->Args({320, 128})
    ->Args({704, 128})
    ->Args({1024, 256})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

/// 48^3 voxels of the room, and the same by comparing every voxel with every obstacle.
GridMap corner_of_the_room() {
  GridSpec grid = FurnishedRoom::grid(0.1);
  grid.size_vox.setConstant(48);
  GridMap map(grid);
  std::mt19937 random(2);
  std::uniform_int_distribution<int> side(0, 47);
  for (int i = 0; i < 2000; ++i) map.set({side(random), side(random), side(random) / 4}, true);
  return map;
}

void small_transform(benchmark::State& state) {
  GridMap map = corner_of_the_room();
  WorkerPool workers(1);
  MapUpdate update = map.take_update();
  update.changed_blocks = all_blocks(map.grid());
  for (auto _ : state) {
    auto builder = edt::make_edt_builder(options(false, false), workers);
    if (!builder->attach(map)) state.SkipWithError("attach failed");
    auto field = builder->update(update);
    benchmark::DoNotOptimize(field);
  }
}
BENCHMARK(small_transform)->Unit(benchmark::kMillisecond);

void small_brute_force(benchmark::State& state) {
  const GridMap map = corner_of_the_room();
  const GridSpec& grid = map.grid();
  const int n = grid.size_vox.x();
  std::vector<Eigen::Vector3i> voxels, obstacles;
  for (int i = 0; i < n * n * n; ++i) {
    voxels.emplace_back(i % n, i / n % n, i / (n * n));
    if (map.occupied().at(grid, voxels.back())) obstacles.push_back(voxels.back());
  }
  for (auto _ : state) {
    for (const Eigen::Vector3i& voxel : voxels) {
      int best = std::numeric_limits<int>::max();
      for (const Eigen::Vector3i& obstacle : obstacles) {
        best = std::min(best, (obstacle - voxel).squaredNorm());
      }
      benchmark::DoNotOptimize(best);
    }
  }
}
BENCHMARK(small_brute_force)->Unit(benchmark::kMillisecond)->Iterations(1);

/// 10,000 points: anywhere in the room, or along the paths of 100 moving spheres.
void query(benchmark::State& state) {
  GridMap map(FurnishedRoom::grid(0.025));
  WorkerPool workers(2);
  FurnishedRoom::furnish(map);
  auto builder = edt::make_edt_builder(options(false, true), workers);
  if (!builder->attach(map)) state.SkipWithError("attach failed");
  const auto field = builder->update(map.take_update());
  const bool along_paths = state.range(0) != 0;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> within(0.0, 1.0);
  const Eigen::Vector3d room_m = map.grid().upper_m();
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d p;
  for (int i = 0; i < 10000; ++i) {
    if (!along_paths || i % 100 == 0) {
      p = Eigen::Vector3d(within(random), within(random), within(random)).cwiseProduct(room_m);
    }
    points.push_back(p);
    p.x() += 0.01;
  }
  std::vector<double> distances(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  std::vector<FieldStatus> statuses(points.size());
  for (auto _ : state) {
    (*field)->query(points, distances, gradients, statuses);
    benchmark::DoNotOptimize(distances.data());
    benchmark::ClobberMemory();
  }
  state.counters["per_point"] = benchmark::Counter(
      static_cast<double>(points.size()),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(query)->ArgName("along_paths")->Arg(0)->Arg(1)->Unit(benchmark::kMicrosecond);

}  // namespace
