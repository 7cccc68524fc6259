#include "downhill.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <sidestep/conformance/optimiser_conformance.hpp>
#include <sidestep/conformance/test_host.hpp>

namespace {

using namespace sidestep;
using namespace sidestep::conformance;

/// With nothing but the GP prior, the way from rest to rest is the cubic of least acceleration,
/// 3 s^2 - 2 s^3 of it after the share s of the time T, and costs 6 D^2 / (qc T^3) for each joint.
TEST(Downhill, FindsTheCubicWhereThereIsNothingInTheWay) {
  Problem problem = reference_problem();
  problem.terms.clear();
  problem.qc = Eigen::Vector4d(1.0, 0.5, 2.0, 4.0);
  TestHost host;
  const auto optimiser = *downhill::create({.relative_tolerance = 1e-12}, host.context());
  const auto solution = optimiser->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution) << solution.error().describe();
  const Eigen::VectorXd way = problem.goal.q - problem.start.q;
  const double duration_s = problem.dt_s * (problem.support_states - 1);
  double cost = 0.0;
  for (int j = 0; j < 4; ++j) {
    cost += 6.0 * way[j] * way[j] / problem.qc[j] / std::pow(duration_s, 3);
    for (int i = 0; i < problem.support_states; ++i) {
      const double s = i * problem.dt_s / duration_s;
      const auto joint = static_cast<std::size_t>(j);
      EXPECT_NEAR(solution->trajectory.q(i)[joint],
                  problem.start.q[j] + way[j] * s * s * (3.0 - 2.0 * s), 1e-6);
      EXPECT_NEAR(solution->trajectory.qdot(i)[joint], way[j] * 6.0 * s * (1.0 - s) / duration_s,
                  1e-6);
    }
  }
  EXPECT_NEAR(solution->cost, cost, 1e-9 * cost);
}

}  // namespace
