// What a map costs with ten people: each predictor for 6 s, and the cost "moving" of a problem.
#include <benchmark/benchmark.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

#include "conformance/cost_conformance.hpp"
#include "conformance/predictor_conformance.hpp"
#include "predictor_loader.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

constexpr double kHorizon_s = 6.0;

void predict_ten(benchmark::State& state, const std::string& block) {
  SceneObject wall;
  wall.shape = Box{{0.2, 20.0, 3.0}};
  wall.waypoints = {{0.0, Transform(Eigen::Translation3d(4.0, 0.0, 1.5))}};
  const SceneField field(Scene({wall}), {},
                         {Eigen::Vector3d(-30.0, -30.0, -1.0), Eigen::Vector3d(30.0, 30.0, 4.0)});
  const auto predictor = testing_support::load_predictor(block);
  const Tracks people = conformance::walking_people(10, 1);
  PredictionRequest request{people, kHorizon_s};
  request.field = &field;
  for (auto _ : state) benchmark::DoNotOptimize(predictor->predict(request));
}
BENCHMARK_CAPTURE(predict_ten, worst_case, std::string("{plugin: worst_case}"));
BENCHMARK_CAPTURE(predict_ten, constant_velocity, std::string("{plugin: constant_velocity}"));
BENCHMARK_CAPTURE(predict_ten, goal_directed, std::string("{plugin: goal_directed}"));
BENCHMARK_CAPTURE(predict_ten, orca, std::string("{plugin: orca}"));

/// All states of 25 support states with 4 checks between each two, as a solver linearises them.
void linearise_moving(benchmark::State& state) {
  const auto robot = testing_support::mobile_arm();
  const auto predictor = testing_support::load_predictor("{plugin: constant_velocity}");
  const Tracks people = conformance::walking_people(10, 1);
  const auto prediction = std::make_shared<const Prediction>(
      predictor->predict(PredictionRequest{people, kHorizon_s}).value());
  const auto cost = make_moving_obstacle_cost(robot, prediction, 0.0, 0.3, 0.05);
  constexpr int kStates = 121;
  const conformance::States states =
      conformance::random_states(robot->description().dof(), kStates, 1.5, 1.0);
  StateNormals normals;
  normals.resize(kStates, robot->description().dof());
  Scratch scratch;
  for (auto _ : state) {
    benchmark::DoNotOptimize(cost->linearise(states.batch(), {}, normals, scratch));
  }
}
BENCHMARK(linearise_moving);

}  // namespace
}  // namespace sidestep
