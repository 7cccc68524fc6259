#include <sidestep/planning/initial_guess.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <sidestep/core/seed.hpp>

namespace sidestep {
namespace {

constexpr int kWaves = 3;
constexpr double kLargestBend = 0.4;  // m, rad

/// How far a joint is bent in the first attempt that bends.
double bend_scale(const Joint& joint) {
  return std::min(0.15 * (joint.upper - joint.lower), kLargestBend);
}

}  // namespace

Trajectory initial_guess(const Problem& problem, int attempt, std::uint64_t seed) {
  Trajectory guess =
      straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
  if (attempt == 0) return guess;

  std::mt19937_64 random(derive_seed(seed, "initial_guess/" + std::to_string(attempt)));
  std::normal_distribution<double> normal;
  const std::vector<Joint>& joints = problem.robot->description().joints;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    double amplitudes[kWaves];
    for (int k = 0; k < kWaves; ++k) {
      amplitudes[k] = normal(random) * bend_scale(joints[j]) * std::sqrt(attempt) / (k + 1);
    }
    for (int i = 1; i + 1 < guess.size(); ++i) {
      const double phase = std::numbers::pi * i / (guess.size() - 1);
      double& q = guess.q(i)[j];
      for (int k = 0; k < kWaves; ++k) q += amplitudes[k] * std::sin((k + 1) * phase);
      q = std::clamp(q, joints[j].lower, joints[j].upper);
    }
    // Velocities that fit the bent positions, wherever the limits cut them.
    for (int i = 1; i + 1 < guess.size(); ++i) {
      guess.qdot(i)[j] = (guess.q(i + 1)[j] - guess.q(i - 1)[j]) / (2.0 * problem.dt_s);
    }
  }
  return guess;
}

}  // namespace sidestep
