#include "conformance/analytic_models.hpp"
#include "conformance/cost_conformance.hpp"
#include "conformance/executor_conformance.hpp"
#include "conformance/gaze_conformance.hpp"
#include "conformance/optimiser_conformance.hpp"
#include "conformance/predictor_conformance.hpp"
#include "conformance/robot_conformance.hpp"

#include "subject.hpp"

namespace sidestep::conformance {
namespace {

using validate::cases_of;
using validate::subject;

OptimiserCase optimiser_case() {
  return {.name = {},
          .make = [] { return subject()->make<Optimiser>(); },
          .minimises_cost = subject()->expect().minimises_cost,
          .repeatable = subject()->expect().repeatable};
}
INSTANTIATE_TEST_SUITE_P(plugin, OptimiserConformance,
                         testing::ValuesIn(cases_of(PluginKind::kOptimiser, optimiser_case)));

PredictorCase predictor_case() {
  return {.name = {}, .make = [] { return subject()->make<Predictor>(); }};
}
INSTANTIATE_TEST_SUITE_P(plugin, PredictorConformance,
                         testing::ValuesIn(cases_of(PluginKind::kPredictor, predictor_case)));

GazeCase gaze_case() {
  return {.name = {}, .make = [](auto robot) { return subject()->make<Gaze>({.robot = robot}); }};
}
INSTANTIATE_TEST_SUITE_P(plugin, GazeConformance,
                         testing::ValuesIn(cases_of(PluginKind::kGaze, gaze_case)));

ExecutorCase executor_case() {
  return {
      .name = {},
      .make =
          [](auto robot, const Clock& clock, auto motion) {
            return subject()->make<Executor>({.robot = robot, .motion = motion, .clock = &clock});
          },
      .tracking_error = subject()->expect().tracking_error,
      .delay_s = subject()->expect().delay_s,
      .braking_share = subject()->expect().braking_share};
}
INSTANTIATE_TEST_SUITE_P(plugin, ExecutorConformance,
                         testing::ValuesIn(cases_of(PluginKind::kExecutor, executor_case)));

/// Suites that are functions.
class RobotConformance : public testing::TestWithParam<int> {};
TEST_P(RobotConformance, Conforms) { check_robot(*subject()->make<RobotModel>()); }
INSTANTIATE_TEST_SUITE_P(plugin, RobotConformance,
                         testing::ValuesIn(cases_of(PluginKind::kRobot, [] { return 0; })));

class CostConformance : public testing::TestWithParam<int> {};
TEST_P(CostConformance, Conforms) {
  const auto& robot = subject()->robot();
  const auto cost = subject()->make<StateCost>({.robot = robot});
  constexpr int kStates = 60;
  States states = random_states(robot->description().dof(), kStates, 0.0, 1.0);
  states.q = random_configurations(robot->description(), kStates, 1);
  expect_conforms(*cost, states);
}
INSTANTIATE_TEST_SUITE_P(plugin, CostConformance,
                         testing::ValuesIn(cases_of(PluginKind::kCost, [] { return 0; })));

}  // namespace
}  // namespace sidestep::conformance
