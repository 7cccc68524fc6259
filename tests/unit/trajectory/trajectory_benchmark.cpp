#include <cmath>
#include <numbers>
#include <vector>

#include <benchmark/benchmark.h>
#include <Eigen/Dense>

#include <sidestep/trajectory/gp_prior.hpp>
#include <sidestep/trajectory/retime.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {
namespace {

constexpr int kDof = 8;

Trajectory sine(int states) {
  Trajectory out = make_trajectory(kDof, states, 0.1);
  for (std::size_t i = 0; i < out.positions.size(); ++i) {
    out.positions[i] = std::sin(0.1 * static_cast<double>(i));
    out.velocities[i] = std::cos(0.1 * static_cast<double>(i));
  }
  return out;
}

void sample(benchmark::State& state) {
  const Trajectory trajectory = sine(40);
  std::vector<double> q(kDof), qdot(kDof);
  double time_s = 0.0;
  for (auto _ : state) {
    time_s = time_s > 3.8 ? 0.01 : time_s + 0.0173;
    trajectory.sample(time_s, q, qdot);
    benchmark::DoNotOptimize(q.data());
    benchmark::DoNotOptimize(qdot.data());
  }
}
BENCHMARK(sample);

/// The formulas of the GP's posterior mean as they are written, with dense matrices.
void sample_dense_reference(benchmark::State& state) {
  const Trajectory trajectory = sine(40);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(kDof, kDof);
  const auto phi = [&](double s) {
    Eigen::MatrixXd out = Eigen::MatrixXd::Identity(2 * kDof, 2 * kDof);
    out.topRightCorner(kDof, kDof) = s * identity;
    return out;
  };
  const auto noise = [&](double s) {
    Eigen::MatrixXd out(2 * kDof, 2 * kDof);
    out << s * s * s / 3 * identity, s * s / 2 * identity, s * s / 2 * identity, s * identity;
    return out;
  };
  const Eigen::MatrixXd inverse = noise(0.1).inverse();
  Eigen::VectorXd a = Eigen::VectorXd::Random(2 * kDof), b = Eigen::VectorXd::Random(2 * kDof);
  double s = 0.0;
  for (auto _ : state) {
    s = s > 0.09 ? 0.001 : s + 0.00173;
    const Eigen::MatrixXd psi = noise(s) * phi(0.1 - s).transpose() * inverse;
    const Eigen::VectorXd x = (phi(s) - psi * phi(0.1)) * a + psi * b;
    benchmark::DoNotOptimize(x.data());
  }
}
BENCHMARK(sample_dense_reference);

/// A bent motion from rest to rest of `states` support states.
Trajectory bent(int states) {
  Trajectory out = make_trajectory(kDof, states, 4.0 / (states - 1));
  for (int i = 0; i < states; ++i) {
    const double f = static_cast<double>(i) / (states - 1), turn = 2.0 * std::numbers::pi;
    for (std::size_t j = 0; j < kDof; ++j) {
      const double way = 1.0 - 0.3 * static_cast<double>(j),
                   wave = 0.1 * static_cast<double>(j % 3);
      out.q(i)[j] = way * f * f * (3.0 - 2.0 * f) + wave * (1.0 - std::cos(turn * f));
      out.qdot(i)[j] = (way * 6.0 * f * (1.0 - f) + wave * turn * std::sin(turn * f)) / 4.0;
    }
  }
  return out;
}

void retime_path(benchmark::State& state) {
  const Trajectory path = bent(static_cast<int>(state.range(0)));
  const MotionLimits limits{std::vector<double>(kDof, 1.0), std::vector<double>(kDof, 1.5), {}};
  const RetimeSettings settings{.least_stages = static_cast<int>(state.range(1))};
  double duration_s = 0.0, states = 0.0;
  for (auto _ : state) {
    const auto retimed = retime(path, limits, settings);
    duration_s = retimed->trajectory.duration_s();
    states = retimed->trajectory.size();
  }
  state.counters["duration_s"] = duration_s;
  state.counters["states"] = states;
}
BENCHMARK(retime_path)
    ->ArgNames({"states", "stages"})
    ->ArgsProduct({{20, 50}, {100, 400, 1600}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace sidestep
