#pragma once

#include <algorithm>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/initial_guess.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "support/hsr_table.hpp"

#include "describe.hpp"
#include "gp_chain.hpp"

/// Problems for batches, and what is known of them by other means.
namespace sidestep::gp_chain_cuda::test {

/// A chain of links that turn about y and z in turn, with spheres: more joints than most have.
[[nodiscard]] inline std::shared_ptr<const RobotModel> long_arm(int joints) {
  RobotDescription arm;
  arm.name = "long_arm";
  std::vector<TreeJoint> tree(1);
  arm.links.push_back({"base", -1});
  for (int j = 0; j < joints; ++j) {
    const std::string name = "joint_" + std::to_string(j);
    arm.joints.push_back({name, Joint::Type::kRevolute, -2.0, 2.0, 1.5, 5.0});
    arm.links.push_back({"link_" + std::to_string(j), j});
    TreeJoint joint{.name = name,
                    .motion = TreeJoint::Motion::kRotation,
                    .axis = j % 2 == 0 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ(),
                    .joint = j};
    joint.T_parent_joint.translation() = Eigen::Vector3d(0.18, 0.0, 0.01 * j);
    tree.push_back(joint);
    arm.spheres.push_back({j + 1, {0.05, 0.0, 0.0}, 0.05});
    arm.spheres.push_back({j + 1, {0.12, 0.01, 0.0}, 0.06});
    if (j > 2) arm.self_collision_pairs.push_back({j - 2, j + 1});
  }
  return KinematicTree::create(std::move(arm), std::move(tree)).value();
}

/// The HSR at its table with every cost of planning/costs.hpp, the goal left to the hand's pose.
[[nodiscard]] inline Problem hsr_of_every_cost() {
  Problem problem = testing_support::hsr_reaches_table(13, 3);
  problem.space = {Space::kOccupied, Space::kOccupied, Floor{0.0, {"base_link"}}};
  problem.terms = standard_terms(problem, {.epsilon_m = 0.25, .hold_goal = false});
  const auto& robot = problem.robot;
  const auto add = [&](Result<std::unique_ptr<StateCost>> cost, Placement placement) {
    problem.terms.push_back({std::move(cost).value(), placement});
  };
  Transform target = Transform::Identity();
  target.translate(Eigen::Vector3d(0.8, 0.1, 0.85));
  target.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, 0.9, 0.1).normalized()));
  const auto along = Placement::kSupportAndInterpolated;
  add(make_link_pose_cost(robot, "hand_palm_link", target, 0.02, 0.1), Placement::kGoal);
  add(make_link_position_cost(robot, "arm_flex_link", target.translation(), 2.0),
      Placement::kSupport);
  add(make_link_orientation_cost(robot, "wrist_roll_link", target.linear(), 0.8), along);
  add(make_link_axis_cost(robot, "hand_palm_link", Eigen::Vector3d::UnitX(),
                          target.linear() * Eigen::Vector3d::UnitX(), 0.5),
      along);
  const int dof = robot->description().dof();
  Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(dof, 1.5);
  sigmas[0] = std::numeric_limits<double>::infinity();
  add(make_posture_cost(robot->description(), problem.start.q, sigmas), Placement::kSupport);
  return problem;
}

/// A long arm that bends around a ball.
[[nodiscard]] inline Problem long_arm_bends(int joints) {
  Problem problem;
  problem.robot = long_arm(joints);
  GridSpec grid;
  grid.origin_m = {-2.5, -2.5, -2.5};
  grid.resolution_m = 0.05;
  grid.size_vox = {100, 100, 100};
  problem.field = testing_support::sampled_field(grid, [](const Eigen::Vector3d& p) {
    return (p - Eigen::Vector3d(1.2, 0.35, 0.1)).norm() - 0.25;
  });
  problem.space = {Space::kFree, Space::kFree};
  problem.start = {Eigen::VectorXd::Constant(joints, -0.12), Eigen::VectorXd::Zero(joints)};
  problem.goal = {Eigen::VectorXd::Constant(joints, 0.15), Eigen::VectorXd::Zero(joints)};
  problem.support_states = 9;
  problem.dt_s = 0.5;
  problem.qc = Eigen::VectorXd::Ones(joints);
  problem.interpolated_checks = 2;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.15});
  return problem;
}

[[nodiscard]] inline Trajectory line_of(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

/// A straight line whose states have been moved about, positions and velocities.
[[nodiscard]] inline Trajectory shaken(const Problem& problem, unsigned seed, double by) {
  Trajectory trajectory = line_of(problem);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, by);
  for (int i = 0; i < trajectory.size(); ++i) {
    for (double& q : trajectory.q(i)) q += normal(random);
    for (double& qdot : trajectory.qdot(i)) qdot += normal(random);
  }
  return trajectory;
}

[[nodiscard]] inline std::vector<double> support_states_of(const Trajectory& trajectory) {
  std::vector<double> support;
  for (int i = 0; i < trajectory.size(); ++i) {
    support.insert(support.end(), trajectory.q(i).begin(), trajectory.q(i).end());
    support.insert(support.end(), trajectory.qdot(i).begin(), trajectory.qdot(i).end());
  }
  return support;
}

/// All blocks of a field.
[[nodiscard]] inline std::vector<FieldBlockOnHost> blocks_of(const DenseField& field) {
  std::vector<FieldBlockOnHost> blocks;
  for (std::size_t b = 0; b < field.blocks().size(); ++b) {
    blocks.push_back({static_cast<std::int32_t>(b), field.blocks().block(b).distance_m.data(),
                      field.known_blocks().block(b).rows.data()});
  }
  return blocks;
}

/// A batch of one problem on the host, from several initial trajectories.
class HostBatch {
 public:
  HostBatch(const Problem& problem, const std::vector<Trajectory>& initial,
            const MinimisationRules& rules = {}, cuda::Order order = cuda::Order::kForward)
      : described_(describe(problem).value()),
        batch_(make_host_batch(cuda::HostBackend(order)).value()) {
    const auto& field = *described_.field;
    EXPECT_TRUE(batch_->set_field(described_.field_shape, blocks_of(field)).has_value());
    for (const Trajectory& one : initial) supports_.push_back(support_states_of(one));
    std::vector<ChainStart> starts;
    for (const auto& support : supports_) starts.push_back({support, described_.own_numbers, 0});
    const auto begun =
        batch_->begin(described_.chain, rules, starts, describe_samples(problem, 1.0));
    EXPECT_TRUE(begun.has_value()) << begun.error().describe();
  }

  [[nodiscard]] ChainBatch& operator*() { return *batch_; }
  [[nodiscard]] ChainBatch* operator->() { return batch_.get(); }

  /// Minimises, `iterations` at a time, to the end.
  BatchOutcome finish(int iterations = 3) {
    auto moving = batch_->move(0);
    while (moving && *moving > 0) moving = batch_->move(iterations);
    EXPECT_TRUE(moving.has_value());
    return batch_->outcome().value();
  }

 private:
  DescribedProblem described_;
  std::unique_ptr<ChainBatch> batch_;
  std::vector<std::vector<double>> supports_;
};

}  // namespace sidestep::gp_chain_cuda::test
