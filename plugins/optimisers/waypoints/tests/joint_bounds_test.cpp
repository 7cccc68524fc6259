#include "waypoints.hpp"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "support/waypoint_problem.hpp"

namespace sidestep {
namespace {

/// A path of the first joint that swings out to 7 m, where 5 m is the limit.
Waypoints swinging(const Problem& problem) {
  Waypoints q = Waypoints::Zero(2, problem.support_states);
  const int last = problem.support_states - 1;
  for (int i = 1; i < last; ++i) q(0, i) = 7.0 * std::sin(M_PI * i / last);
  return q;
}

TEST(JointBounds, AreTheLimitsLessTheMarginThatTheEndsLeave) {
  Problem problem = disc_problem(5, {4.95, 0.0}, {0.0, -5.0});
  const JointBounds bounds(problem, 0.1);
  EXPECT_DOUBLE_EQ(bounds.upper[0], 4.95);
  EXPECT_DOUBLE_EQ(bounds.lower[0], -4.9);
  EXPECT_DOUBLE_EQ(bounds.upper[1], 4.9);
  EXPECT_DOUBLE_EQ(bounds.lower[1], -5.0);
}

/// Twice the least squared distance, as A measures it, from a path to those below a limit: by
/// coordinate ascent on the dual.
double least_move(const Eigen::MatrixXd& a, const Eigen::VectorXd& path, double limit) {
  const Eigen::MatrixXd inverse = a.inverse();
  Eigen::VectorXd multipliers = Eigen::VectorXd::Zero(path.size());
  for (int sweep = 0; sweep < 2000; ++sweep) {
    for (Eigen::Index i = 0; i < path.size(); ++i) {
      const double beyond = path[i] - inverse.row(i).dot(multipliers) - limit;
      multipliers[i] = std::max(0.0, multipliers[i] + beyond / inverse(i, i));
    }
  }
  return multipliers.dot(inverse * multipliers);
}

TEST(KeepWithin, ClearsEveryViolationAndSmoothlySo) {
  const Problem problem = disc_problem(31, {0.0, 0.0}, {0.0, 0.0});
  const DifferenceMetric metric(problem, Derivative::kAcceleration);
  const JointBounds bounds(problem, 0.1);
  const Waypoints before = swinging(problem);
  Waypoints kept = before;
  keep_within(bounds, metric, kept);
  EXPECT_TRUE(bounds.contain(kept));
  EXPECT_TRUE(kept.row(1).isZero(0.0));
  EXPECT_EQ(kept(0, 0), 0.0);
  EXPECT_EQ(kept(0, 30), 0.0);
  const Eigen::MatrixXd a = metric.a();
  const Eigen::VectorXd path = before.row(0).segment(1, 29);
  const Eigen::VectorXd step = kept.row(0).segment(1, 29).transpose() - path;
  EXPECT_LT(step.dot(a * step), 1.05 * least_move(a, path, 4.9));
  const Eigen::VectorXd cut = path.cwiseMin(4.9) - path;
  EXPECT_GT(cut.dot(a * cut), 5.0 * step.dot(a * step));
  EXPECT_GT(kept.row(0).maxCoeff(), 4.5);  // no further in than needed
}

TEST(KeepWithin, LeavesAPathWithinBoundsAlone) {
  const Problem problem = disc_problem(31, {0.0, 0.0}, {0.0, 0.0});
  const Waypoints before = 0.5 * swinging(problem);
  Waypoints kept = before;
  keep_within(JointBounds(problem, 0.1), DifferenceMetric(problem, Derivative::kVelocity), kept);
  EXPECT_EQ(kept, before);
}

/// Of one waypoint beyond a limit: the nearest path, as the metric measures, that has it on the
/// limit; by the full system of optimality conditions.
TEST(KeepWithin, ProjectsASingleViolationInTheMetric) {
  const Problem problem = disc_problem(9, {0.0, 0.0}, {0.0, 0.0});
  const DifferenceMetric metric(problem, Derivative::kAcceleration);
  Waypoints q = Waypoints::Zero(2, 9);
  q(0, 3) = 5.6;
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(8, 8);
  system.topLeftCorner(7, 7) = Eigen::MatrixXd(metric.a());
  system(7, 2) = system(2, 7) = 1.0;
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(8);
  rhs[7] = 4.9 - 5.6;
  const Eigen::VectorXd moved = system.fullPivLu().solve(rhs).head(7);
  const Eigen::RowVectorXd expected = q.row(0).segment(1, 7) + moved.transpose();
  keep_within(JointBounds(problem, 0.1), metric, q);
  EXPECT_TRUE(q.row(0).segment(1, 7).isApprox(expected, 1e-9));
}

}  // namespace
}  // namespace sidestep
