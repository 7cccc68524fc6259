// The HSR through a door and over a table at 2.5 cm: planning, and both checks of the plan.
#include <benchmark/benchmark.h>

#include <sidestep/planning/motion_check.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/runtime/shape_check.hpp>

#include "ompl_optimiser.hpp"
#include "support/hsr_room.hpp"

namespace sidestep::ompl_optimiser {
namespace {

using testing_support::HsrRoom;

constexpr double kResolution_m = 0.025;

Solution plan(const Problem& problem, const char* planner, std::uint64_t seed) {
  Options options;
  options.planner = planner;
  options.max_time_s = 60.0;
  options.optimise_iterations = 1000;
  conformance::RecordingLog log;
  return make_ompl_optimiser(options, seed, log)
      ->solve(problem, Trajectory{}, Deadline())
      .value_or(Solution{});
}

void solve_hsr(benchmark::State& state, const char* planner) {
  const Problem problem = HsrRoom(kResolution_m).problem();
  std::uint64_t seed = 0;
  double duration_s = 0.0;
  double iterations = 0.0;
  for (auto _ : state) {
    const Solution solution = plan(problem, planner, ++seed);
    if (solution.trajectory.size() == 0) state.SkipWithError(solution.reason.c_str());
    duration_s += solution.trajectory.duration_s();
    iterations += solution.iterations;
  }
  state.counters["duration_s"] = duration_s / static_cast<double>(seed);
  state.counters["iterations"] = iterations / static_cast<double>(seed);
}
BENCHMARK_CAPTURE(solve_hsr, RRTConnect, "RRTConnect")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(solve_hsr, RRTstar, "RRTstar")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(solve_hsr, BITstar, "BITstar")->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(solve_hsr, PRM, "PRM")->Unit(benchmark::kMillisecond);

void field_check(benchmark::State& state) {
  const Problem problem = HsrRoom(kResolution_m).problem();
  const Trajectory trajectory = plan(problem, "RRTConnect", 1).trajectory;
  const auto check = make_field_check(problem.robot, problem.field, problem.space,
                                      {.margin_m = problem.collision_margin_m,
                                       .max_step_m = static_cast<double>(state.range(0)) * 1e-3});
  for (auto _ : state) {
    const auto verdict = check->check(trajectory, 0.0, Deadline());
    if (!verdict || !verdict->valid()) state.SkipWithError("not valid");
  }
  state.counters["duration_s"] = trajectory.duration_s();
  state.counters["states"] = trajectory.size();
}
BENCHMARK(field_check)
    ->ArgName("step_mm")
    ->Arg(20)
    ->Arg(50)
    ->Arg(100)
    ->Unit(benchmark::kMillisecond);

void shape_check(benchmark::State& state) {
  const HsrRoom room(kResolution_m);
  const Problem problem = room.problem();
  const Trajectory trajectory = plan(problem, "RRTConnect", 1).trajectory;
  ShapeObstacles obstacles;
  obstacles.resolution_m = kResolution_m;
  obstacles.occupied_centres_m = room.surface_centres(0.3);  // as ragged as a map
  for (auto _ : state) {
    const auto check = make_shape_check(problem.robot, obstacles, {});
    const auto verdict = (*check)->check(trajectory, 0.0, Deadline());
    if (!verdict || !verdict->valid()) state.SkipWithError("not valid");
  }
  state.counters["voxels"] = static_cast<double>(obstacles.occupied_centres_m.size());
}
BENCHMARK(shape_check)->Unit(benchmark::kMillisecond);

void motion_check(benchmark::State& state) {
  const Problem problem = HsrRoom(kResolution_m).problem();
  MotionCheck check(problem.robot, problem.field, problem.space, problem.collision_margin_m);
  std::vector<double> from(problem.start.q.data(), problem.start.q.data() + 8);
  std::vector<double> to = from;
  to[1] -= 0.3;
  to[2] += 0.3;
  to[4] -= 0.3;
  for (auto _ : state) {
    if (!check.is_clear(from, to, 0.005)) state.SkipWithError("not clear");
  }
}
BENCHMARK(motion_check)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep::ompl_optimiser
