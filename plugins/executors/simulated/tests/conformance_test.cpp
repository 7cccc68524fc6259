#include "../simulated_executor.hpp"
#include "conformance/executor_conformance.hpp"
#include "conformance/test_host.hpp"

namespace sidestep::conformance {
namespace {

ExecutorCase simulated_robot(std::string name, const simulated::Options& options, double error) {
  ExecutorCase c;
  c.name = std::move(name);
  c.make = [options](auto robot, const Clock& clock, auto motion) {
    TestHost host(1, {.robot = robot, .clock = &clock, .motion = motion});
    auto made = simulated::create_executor(options, host.context(3));
    if (!made) throw std::runtime_error(made.error().describe());
    return std::shared_ptr<Executor>(std::move(*made));
  };
  c.tracking_error = c.truth_error = error;
  c.delay_s = options.delay_s;
  return c;
}

INSTANTIATE_TEST_SUITE_P(
    Simulated, ExecutorConformance,
    testing::Values(simulated_robot("exact", {}, 1e-3),
                    simulated_robot("late", {.delay_s = 0.12}, 1e-3),
                    simulated_robot("lagging", {.lag_s = 0.02}, 0.012),
                    simulated_robot("noisy", {.delay_s = 0.05, .position_noise = 5e-4}, 3e-3),
                    simulated_robot("seldom_measured", {.measured_rate_hz = 20.0}, 2e-3)),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep::conformance
