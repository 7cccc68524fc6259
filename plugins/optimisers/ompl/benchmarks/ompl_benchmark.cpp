// The HSR through a door and over a table at 2.5 cm: planning, and both checks of the plan.
#include <benchmark/benchmark.h>

#include <random>

#include <sidestep/field/scene_field.hpp>
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

/// A room of boxes and posts as they are, and edges through it from one seed.
struct ShapesRoom {
  ShapesRoom() : problem(HsrRoom(kResolution_m).problem()) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> across(-2.5, 2.5), up(0.1, 1.4), size(0.1, 0.5);
    std::vector<SceneObject> objects(20);
    for (std::size_t i = 0; i < objects.size(); ++i) {
      Transform pose = Transform::Identity();
      pose.translation() << across(random), across(random), up(random);
      objects[i].name = "object" + std::to_string(i);
      objects[i].waypoints = {{0.0, pose}};
      if (i % 3 == 0) {
        objects[i].shape = Cylinder{0.3 * size(random), size(random)};
      } else {
        objects[i].shape = Box{{size(random), size(random), size(random)}};
      }
    }
    field = std::make_shared<const SceneField>(
        Scene(std::move(objects)), Stamp(),
        Eigen::AlignedBox3d(Eigen::Vector3d(-4, -4, -1), Eigen::Vector3d(4, 4, 3)));
    const std::size_t dof = problem.robot->description().joints.size();
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    for (int i = 0; i < 256; ++i) {
      std::vector<double> from(problem.start.q.data(), problem.start.q.data() + dof), to = from;
      for (std::size_t j = 0; j < dof; ++j) {
        from[j] += (j < 2 ? 2.0 : j == 2 ? 3.0 : 0.0) * unit(random);
        to[j] = from[j] + (j < 3 ? 0.4 : 0.1) * unit(random);
      }
      edges.emplace_back(std::move(from), std::move(to));
    }
  }
  Problem problem;
  std::shared_ptr<const SceneField> field;
  std::vector<std::pair<std::vector<double>, std::vector<double>>> edges;
};

/// Each edge shown clear or not over all of its length.
void edges_in_lanes(benchmark::State& state) {
  const ShapesRoom room;
  MotionCheck check(room.problem.robot, room.field, {Space::kFree, Space::kFree}, 0.0);
  int clear = 0;
  std::size_t edge = 0;
  for (auto _ : state) {
    const auto& [from, to] = room.edges[edge++ % room.edges.size()];
    clear += check.is_clear(from, to, 0.005) ? 1 : 0;
  }
  state.counters["clear"] = static_cast<double>(clear) / static_cast<double>(state.iterations());
}
BENCHMARK(edges_in_lanes)->Unit(benchmark::kMicrosecond);

/// The plain version: one configuration after the other, 1/32 apart, each sphere against the field,
/// and nothing between them.
void edges_one_by_one(benchmark::State& state) {
  const ShapesRoom room;
  const RobotDescription& robot = room.problem.robot->description();
  std::vector<Eigen::Vector3d> centres_m(robot.spheres.size());
  std::vector<double> distances_m(robot.spheres.size());
  Scratch scratch;
  const auto is_clear = [&](std::span<const double> q) {
    room.problem.robot->sphere_centres(q, centres_m, scratch);
    room.field->query(centres_m, distances_m, {}, {});
    for (std::size_t s = 0; s < centres_m.size(); ++s) {
      if (distances_m[s] < robot.spheres[s].radius_m) return false;
    }
    for (const auto& [first, second] : robot.self_collision_pairs) {
      for (std::size_t a = 0; a < centres_m.size(); ++a) {
        for (std::size_t b = 0; b < centres_m.size() && robot.spheres[a].link == first; ++b) {
          const double radii_m = robot.spheres[a].radius_m + robot.spheres[b].radius_m;
          if (robot.spheres[b].link != second) continue;
          if ((centres_m[a] - centres_m[b]).squaredNorm() < radii_m * radii_m) return false;
        }
      }
    }
    return true;
  };
  int clear = 0;
  std::size_t edge = 0;
  std::vector<double> q;
  for (auto _ : state) {
    const auto& [from, to] = room.edges[edge++ % room.edges.size()];
    double square = 0.0;
    for (std::size_t j = 0; j < from.size(); ++j) square += (to[j] - from[j]) * (to[j] - from[j]);
    const int steps = static_cast<int>(std::ceil(32.0 * std::sqrt(square)));
    bool is_edge_clear = true;
    for (int k = 0; k <= steps && is_edge_clear; ++k) {
      q = from;
      for (std::size_t j = 0; j < q.size(); ++j) q[j] += k * (to[j] - from[j]) / steps;
      is_edge_clear = is_clear(q);
    }
    clear += is_edge_clear ? 1 : 0;
  }
  state.counters["clear"] = static_cast<double>(clear) / static_cast<double>(state.iterations());
}
BENCHMARK(edges_one_by_one)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep::ompl_optimiser
