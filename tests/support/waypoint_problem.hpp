#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include <Eigen/Cholesky>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>

#include "conformance/analytic_models.hpp"

namespace sidestep {

/// A disc of radius 0.15 m that slides in the plane from one place to another.
inline Problem disc_problem(int waypoints, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  Problem problem;
  problem.robot = std::make_shared<conformance::PlanarRobot>(
      conformance::PlanarRobot::Shape{.rotary_joints = 0, .mobile = true});
  problem.field = std::make_shared<conformance::BallField>(std::vector<conformance::Ball>{});
  problem.start = {from, Eigen::Vector2d::Zero()};
  problem.goal = {to, Eigen::Vector2d::Zero()};
  problem.support_states = waypoints;
  problem.dt_s = 4.0 / (waypoints - 1);
  problem.qc = Eigen::Vector2d::Ones();
  return problem;
}
constexpr double kDiscRadius_m = 0.15;

/// The inner waypoints q of one joint, at rest at 0 at both ends, that minimise the integral of
/// half the squared derivative of that order (1, 2), over a time of 1, plus 1/2 ((q - target) /
/// sigma)^2 at each.
inline Eigen::VectorXd pulled_towards(double target, double sigma, int waypoints, int order) {
  const int last = waypoints - 1;
  const double n = last;
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(waypoints, waypoints);
  for (int i = 0; i <= last; ++i) {
    if (order == 1 && i < last) rows.row(i).segment(i, 2) << -std::sqrt(n), std::sqrt(n);
    if (order == 2 && i > 0 && i < last) {
      rows.row(i).segment(i - 1, 3) << 1.0, -2.0, 1.0;
      rows.row(i) *= n * std::sqrt(n);
    }
  }
  if (order == 2) {  // the neighbour beyond an end is that before it; half weight
    rows(0, 1) = rows(last, last - 1) = std::sqrt(2.0) * n * std::sqrt(n);
  }
  const Eigen::MatrixXd inner = rows.middleCols(1, waypoints - 2);
  Eigen::MatrixXd system = inner.transpose() * inner;
  system.diagonal().array() += 1.0 / (sigma * sigma);
  return system.ldlt().solve(Eigen::VectorXd::Constant(waypoints - 2, target / (sigma * sigma)));
}

/// Length of the shortest way of a point from `from` to `to` around a circle that is in between:
/// two tangents and an arc.
inline double shortest_around(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
                              const Eigen::Vector2d& centre, double radius) {
  const Eigen::Vector2d a = from - centre, b = to - centre;
  const double tangents =
      std::sqrt(a.squaredNorm() - radius * radius) + std::sqrt(b.squaredNorm() - radius * radius);
  const double angle = std::acos(a.dot(b) / (a.norm() * b.norm()));
  return tangents + radius * (angle - std::acos(radius / a.norm()) - std::acos(radius / b.norm()));
}

/// Of the path of the first two joints, from samples 1 ms apart.
inline double length_m(const Trajectory& trajectory) {
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof)),
      before(trajectory.q(0).begin(), trajectory.q(0).end());
  double length = 0.0;
  for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 1e-3) {
    trajectory.sample(time_s, q, {});
    length += std::hypot(q[0] - before[0], q[1] - before[1]);
    before = q;
  }
  return length;
}

}  // namespace sidestep
