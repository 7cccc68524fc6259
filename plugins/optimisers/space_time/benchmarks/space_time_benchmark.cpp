// A ball among five people who cross a circle of 4 m, and the HSR through a door at 2.5 cm.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "space_time.hpp"
#include "support/ball_robot.hpp"
#include "support/hsr_room.hpp"

namespace sidestep {
namespace {

/// As fast and as agile as CrowdNav's robot.
class AgileBall final : public testing_support::BallRobot {
 public:
  AgileBall() : BallRobot(0.3) {
    for (Joint& joint : description_.joints) joint.max_acceleration = 4.0;
  }
};

Problem crossing(std::mt19937& random) {
  std::uniform_real_distribution<double> angle(-M_PI, M_PI), speed(0.5, 1.2);
  std::vector<PredictedSet> sets;
  while (sets.size() < 5) {
    const double a = angle(random);
    const Eigen::Vector2d from_m = 4.0 * Eigen::Vector2d(std::cos(a), std::sin(a));
    if ((from_m - Eigen::Vector2d(0, -4)).norm() < 1.0) continue;
    const Eigen::Vector2d to_m = from_m - 8.0 * speed(random) / 4.0 * from_m;
    sets.push_back({std::ssize(sets) + 1, 1.0, 0.0, 1.8, {{0.0, from_m, 0.3}, {8.0, to_m, 0.45}}});
  }
  Problem problem;
  problem.robot = std::make_shared<AgileBall>();
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {Eigen::Vector3d(0, -4, 0.9), Eigen::Vector3d::Zero()};
  problem.goal = {Eigen::Vector3d(0, 4, 0.9), Eigen::Vector3d::Zero()};
  problem.support_states = 11;
  problem.dt_s = 1.0;
  problem.qc = Eigen::Vector3d::Ones();
  problem.prediction = std::make_shared<const Prediction>(
      Prediction::create(Stamp{}, std::move(sets)).value_or(Prediction()));
  problem.prediction_margin_m = 0.1;
  return problem;
}

void solve(benchmark::State& state, const std::vector<Problem>& problems) {
  const auto planner = make_space_time({});
  double duration_s = 0.0, solved = 0.0, nodes = 0.0, slowest_ms = 0.0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Problem& problem = problems[next++ % problems.size()];
    const auto solution = planner->solve(
        problem, straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s),
        Deadline());
    if (!solution) return state.SkipWithError(solution.error().describe().c_str());
    solved += solution->status == SolveStatus::kConverged ? 1.0 : 0.0;
    duration_s += solution->trajectory.duration_s();
    nodes += solution->iterations;
    slowest_ms = std::max(slowest_ms, solution->solve_ms);
  }
  const auto solves = static_cast<double>(next);
  state.counters["solved"] = solved / solves;
  state.counters["duration_s"] = duration_s / solved;
  state.counters["nodes"] = nodes / solves;
  state.counters["slowest_ms"] = slowest_ms;
}

void solve_crossings(benchmark::State& state) {
  std::mt19937 random(11);
  std::vector<Problem> problems;
  for (int scene = 0; scene < 100; ++scene) problems.push_back(crossing(random));
  solve(state, problems);
}
BENCHMARK(solve_crossings)->Unit(benchmark::kMillisecond)->Iterations(100);

void solve_hsr_door(benchmark::State& state) {
  solve(state, {testing_support::HsrRoom(0.025).problem()});
}
BENCHMARK(solve_hsr_door)->Unit(benchmark::kMillisecond)->Iterations(5);

}  // namespace
}  // namespace sidestep
