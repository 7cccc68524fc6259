// Inverse kinematics of the hand's poses in random configurations, until the first configuration
// that reaches each, from random seeds: the median and the slow ones of a thousand.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/inverse_kinematics.hpp>

#include "support/hsr.hpp"

namespace sidestep {
namespace {

constexpr int kPoses = 1000;
constexpr int kMostSeeds = 200;

/// A goal that is the pose of a link in a configuration drawn within the limits.
Problem pose_problem(const std::shared_ptr<const RobotModel>& robot, const std::string& link,
                     std::mt19937& random) {
  const RobotDescription& is = robot->description();
  Problem problem;
  problem.robot = robot;
  problem.start = problem.goal = {Eigen::VectorXd::Zero(is.dof()), Eigen::VectorXd::Zero(is.dof())};
  Eigen::VectorXd q(is.dof());
  for (int j = 0; j < is.dof(); ++j) {
    const Joint& joint = is.joints[static_cast<std::size_t>(j)];
    const double low = std::max(joint.lower, -3.0), high = std::min(joint.upper, 3.0);
    q[j] = std::uniform_real_distribution<double>(low, high)(random);
    problem.start.q[j] = problem.goal.q[j] = std::clamp(0.0, joint.lower, joint.upper);
  }
  std::vector<Transform> poses(is.links.size());
  Scratch scratch;
  robot->link_poses({q.data(), static_cast<std::size_t>(q.size())}, poses, scratch);
  auto cost = make_link_pose_cost(
      robot, link, poses[static_cast<std::size_t>(is.link_index(link).value())], 1e-3, 5e-3);
  problem.terms.push_back({std::move(cost).value(), Placement::kGoal});
  return problem;
}

void poses_of(benchmark::State& state, const std::string& profile, const std::string& link) {
  const auto robot = testing_support::load_profile(profile);
  std::mt19937 random(11);
  std::vector<Problem> problems;
  for (int i = 0; i < kPoses; ++i) problems.push_back(pose_problem(robot, link, random));
  std::vector<double> times_ms;
  double found = 0.0, seeds = 0.0;
  std::size_t next = 0;
  for (auto _ : state) {
    const Stopwatch watch;
    InverseKinematics kinematics(problems[next % kPoses], next);
    bool is_found = false;
    while (!is_found && kinematics.seeds() < kMostSeeds) is_found = kinematics.next().size() > 0;
    times_ms.push_back(watch.elapsed_ms());
    found += is_found;
    seeds += kinematics.seeds();
    ++next;
  }
  std::ranges::sort(times_ms);
  const auto share = [&](double part) {
    return times_ms[static_cast<std::size_t>(part * static_cast<double>(times_ms.size() - 1))];
  };
  state.counters["p50_ms"] = share(0.5);
  state.counters["p95_ms"] = share(0.95);
  state.counters["most_ms"] = times_ms.back();
  state.counters["found"] = found / static_cast<double>(times_ms.size());
  state.counters["seeds"] = seeds / static_cast<double>(times_ms.size());
}
BENCHMARK_CAPTURE(poses_of, panda, "panda", "panda_hand")->Iterations(kPoses);
BENCHMARK_CAPTURE(poses_of, fetch, "fetch", "gripper_link")->Iterations(kPoses);
BENCHMARK_CAPTURE(poses_of, hsr, "hsr", "hand_palm_link")->Iterations(kPoses);

}  // namespace
}  // namespace sidestep
