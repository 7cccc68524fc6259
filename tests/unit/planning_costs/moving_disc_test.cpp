#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/initial_guess.hpp>

#include "chomp.hpp"
#include "gp_ceres.hpp"
#include "gp_chain.hpp"
#include "stomp.hpp"
#include "support/waypoint_problem.hpp"
#include "trajopt.hpp"

namespace sidestep {
namespace {

constexpr double kMovingRadius_m = 0.25;

/// Where the other disc is: on the straight line halfway, when the robot is.
Eigen::Vector2d other_m(double time_s) { return {0.0, 0.05 + 0.8 * (time_s - 2.0)}; }

/// A disc goes from (-1, 0) to (1, 0) in 4 s; another, which its prediction knew 3 s before,
/// crosses.
Problem crossing(bool moves) {
  Problem problem = disc_problem(41, {-1.0, 0.0}, {1.0, 0.0});
  problem.interpolated_checks = 1;
  if (moves) {
    PredictedSet set;
    set.bottom_m = -1.0;
    set.top_m = 1.0;
    for (const double time_s : {-3.0, 6.0}) {
      set.knots.push_back({time_s + 3.0, other_m(time_s), kMovingRadius_m});
    }
    problem.prediction = std::make_shared<const Prediction>(Prediction::create({}, {set}).value());
    problem.prediction_from_s = 3.0;
  }
  problem.terms = standard_terms(problem, {});
  return problem;
}

/// The least distance between the two discs.
double clearance_m(const Trajectory& trajectory) {
  double least_m = 1e9;
  std::vector<double> q(2);
  for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 1e-3) {
    trajectory.sample(time_s, q, {});
    const double between_m = (Eigen::Vector2d(q[0], q[1]) - other_m(time_s)).norm();
    least_m = std::min(least_m, between_m - kDiscRadius_m - kMovingRadius_m);
  }
  return least_m;
}

struct NamedOptimiser {
  std::string name;
  std::function<std::unique_ptr<Optimiser>()> make;
};

class AmongMovingDiscs : public testing::TestWithParam<NamedOptimiser> {};

TEST_P(AmongMovingDiscs, KeepsClearOfOneThatCrosses) {
  for (const bool moves : {false, true}) {
    const Problem problem = crossing(moves);
    const Trajectory straight = straight_line(problem.start, problem.goal, 41, problem.dt_s);
    ASSERT_LT(clearance_m(straight), -0.3);
    const auto solution = GetParam().make()->solve(problem, straight, Deadline());
    ASSERT_TRUE(solution) << solution.error().describe();
    ASSERT_EQ(solution->trajectory.size(), 41) << solution->reason;
    EXPECT_NEAR(solution->trajectory.q(40)[0], 1.0, 1e-3);
    EXPECT_NEAR(solution->trajectory.q(40)[1], 0.0, 1e-3);
    if (moves) {
      EXPECT_GT(clearance_m(solution->trajectory), 0.02) << solution->reason;
    } else {
      EXPECT_LT(clearance_m(solution->trajectory), -0.3);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Optimisers, AmongMovingDiscs,
    testing::Values(NamedOptimiser{"gp_chain", [] { return make_gp_chain({}); }},
                    NamedOptimiser{"gp_ceres", [] { return make_gp_ceres({}); }},
                    NamedOptimiser{"chomp", [] { return make_chomp({}); }},
                    NamedOptimiser{"stomp", [] { return make_stomp({}); }},
                    NamedOptimiser{"trajopt", [] { return make_trajopt({}); }}),
    [](const auto& of) { return of.param.name; });

}  // namespace
}  // namespace sidestep
