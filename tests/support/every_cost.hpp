#pragma once

#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <sidestep/planning/costs.hpp>

#include "conformance/analytic_models.hpp"

namespace sidestep::testing_support {

/// An upright mobile arm of four links above a floor and beside two balls, with every cost of
/// planning/costs.hpp: the goal configuration is left to the pose of the arm's end.
[[nodiscard]] inline Problem problem_of_every_cost() {
  using conformance::Ball;
  using conformance::BallField;
  using conformance::PlanarRobot;
  Problem problem;
  const auto robot = std::make_shared<PlanarRobot>(
      PlanarRobot::Shape{.rotary_joints = 4, .mobile = true, .upright = true});
  problem.robot = robot;
  problem.field = std::make_shared<BallField>(
      std::vector<Ball>{{{0.9, 0.0, 0.5}, 0.2}, {{0.3, -0.1, -0.8}, 0.3}});
  problem.space.floor = Floor{-1.0, {"base"}};
  const int dof = robot->description().dof();
  problem.start = {Eigen::VectorXd::Constant(dof, 0.2), Eigen::VectorXd::Zero(dof)};
  problem.goal = {Eigen::VectorXd::Constant(dof, 0.4), Eigen::VectorXd::Zero(dof)};
  problem.support_states = 11;
  problem.dt_s = 0.4;
  problem.qc = Eigen::VectorXd::Ones(dof);
  problem.interpolated_checks = 3;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.3, .hold_goal = false});

  const auto add = [&](Result<std::unique_ptr<StateCost>> cost, Placement placement) {
    problem.terms.push_back({std::move(cost).value(), placement});
  };
  Transform target = Transform::Identity();
  target.translate(Eigen::Vector3d(1.4, 0.0, 0.6));
  target.rotate(Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitY()));
  const auto along = Placement::kSupportAndInterpolated;
  add(make_link_pose_cost(robot, "link_4", target, 0.01, 0.05), Placement::kGoal);
  add(make_link_position_cost(robot, "link_2", target.translation(), 2.0), Placement::kSupport);
  add(make_link_orientation_cost(robot, "link_3", target.linear(), 0.8), along);
  add(make_link_axis_cost(robot, "link_1", Eigen::Vector3d::UnitX(),
                          target.linear() * Eigen::Vector3d::UnitX(), 0.5),
      along);
  Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(dof, 1.5);
  sigmas[0] = std::numeric_limits<double>::infinity();
  add(make_posture_cost(robot->description(), Eigen::VectorXd::Constant(dof, 0.3), sigmas),
      Placement::kSupport);
  add(make_state_prior("near_goal", problem.goal, 3.0), Placement::kSupport);
  return problem;
}

}  // namespace sidestep::testing_support
