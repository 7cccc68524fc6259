#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <ostream>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/optimiser.hpp>

#include "analytic_models.hpp"

/// What every Optimiser must hold. In a test of your own:
///
///     INSTANTIATE_TEST_SUITE_P(Mine, OptimiserConformance,
///                              testing::Values(OptimiserCase{"mine", [] { return make_mine();
///                              }}));
namespace sidestep::conformance {

struct OptimiserCase {
  std::string name;
  std::function<std::shared_ptr<Optimiser>()> make;
  /// False for sampling planners: they may ignore the initial trajectory and the cost terms.
  bool minimises_cost = true;
  /// False where libraries keep random state of their own in the process.
  bool repeatable = true;

  friend std::ostream& operator<<(std::ostream& out, const OptimiserCase& c) {
    return out << c.name;
  }
};

/// A robot of 4 joints that drives past a ball which stands slightly off its straight line.
[[nodiscard]] inline Problem reference_problem() {
  Problem problem;
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{2, true});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{1.0, 0.2, 0.0}, 0.25}});
  problem.space = {Space::kOccupied, Space::kOccupied};
  problem.start = {Eigen::Vector4d(0.0, 0.0, 2.0, 0.5), Eigen::Vector4d::Zero()};
  problem.goal = {Eigen::Vector4d(2.0, 0.1, -1.0, -0.5), Eigen::Vector4d::Zero()};
  problem.support_states = 15;
  problem.dt_s = 0.4;
  problem.qc = Eigen::Vector4d::Constant(1.0);
  problem.interpolated_checks = 2;
  CostSettings settings;
  settings.epsilon_m = 0.2;
  problem.terms = standard_terms(problem, settings);
  return problem;
}

[[nodiscard]] inline Trajectory straight_line_of(const Problem& problem) {
  return straight_line(problem.start, problem.goal, problem.support_states, problem.dt_s);
}

inline void expect_state(std::span<const double> actual, const Eigen::VectorXd& expected,
                         const char* what) {
  for (Eigen::Index j = 0; j < expected.size(); ++j) {
    EXPECT_NEAR(actual[static_cast<std::size_t>(j)], expected[j], 1e-3) << what << ", joint " << j;
  }
}

/// The lowest point of any sphere of the robot along a trajectory.
[[nodiscard]] inline double height_m(const Problem& problem, const Trajectory& trajectory) {
  const auto& spheres = problem.robot->description().spheres;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  std::vector<Eigen::Vector3d> centres(spheres.size());
  Scratch scratch;
  double lowest = std::numeric_limits<double>::infinity();
  for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 0.01) {
    trajectory.sample(time_s, q, {});
    problem.robot->sphere_centres(q, centres, scratch);
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      lowest = std::min(lowest, centres[s].z() - spheres[s].radius_m);
    }
  }
  return lowest;
}

/// The smallest distance between a sphere of the robot and an obstacle along a trajectory.
[[nodiscard]] inline double clearance_m(const Problem& problem, const Trajectory& trajectory) {
  const auto& spheres = problem.robot->description().spheres;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  std::vector<Eigen::Vector3d> centres(spheres.size());
  std::vector<double> distances(spheres.size());
  Scratch scratch;
  double least = std::numeric_limits<double>::infinity();
  for (double time_s = 0.0; time_s <= trajectory.duration_s(); time_s += 0.01) {
    trajectory.sample(time_s, q, {});
    problem.robot->sphere_centres(q, centres, scratch);
    problem.field->query(centres, distances, {}, {});
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      least = std::min(least, distances[s] - spheres[s].radius_m);
    }
  }
  return least;
}

/// What must be true of a solution whatever its status.
inline void expect_well_formed(const Problem& problem, const Solution& solution) {
  EXPECT_GE(solution.iterations, 0);
  EXPECT_GE(solution.solve_ms, 0.0);
  if (solution.status != SolveStatus::kConverged) {
    EXPECT_FALSE(solution.reason.empty());
  }
  if (solution.status == SolveStatus::kFailed || solution.status == SolveStatus::kNoPath) {
    EXPECT_EQ(solution.trajectory.size(), 0);
    return;
  }
  EXPECT_TRUE(std::isfinite(solution.cost));
  if (solution.trajectory.size() == 0) return;  // nothing yet at the deadline
  const auto valid = solution.trajectory.validate();
  EXPECT_TRUE(valid.has_value()) << valid.error().describe();
  EXPECT_EQ(solution.trajectory.dof, problem.robot->description().dof());
}

inline void expect_reaches_goal(const Problem& problem, const Solution& solution) {
  expect_well_formed(problem, solution);
  EXPECT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
  ASSERT_GE(solution.trajectory.size(), 2);
  const int last = solution.trajectory.size() - 1;
  expect_state(solution.trajectory.q(0), problem.start.q, "position at the start");
  expect_state(solution.trajectory.qdot(0), problem.start.qdot, "velocity at the start");
  expect_state(solution.trajectory.q(last), problem.goal.q, "position at the goal");
  expect_state(solution.trajectory.qdot(last), problem.goal.qdot, "velocity at the goal");
}

/// A cost of no weight that counts its evaluations and asks to stop at one of them.
class StoppingCost final : public StateCost {
 public:
  StoppingCost(std::stop_source stop, int stop_at) : stop_(std::move(stop)), stop_at_(stop_at) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "stopping"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch&, const CostBatch& out, Scratch&) const override {
    std::fill(out.residuals.begin(), out.residuals.end(), 0.0);
    std::fill(out.jacobian_q.begin(), out.jacobian_q.end(), 0.0);
    std::fill(out.jacobian_qdot.begin(), out.jacobian_qdot.end(), 0.0);
    const std::lock_guard lock(mutex_);
    if (++evaluations_ == stop_at_) stop_.request_stop();
  }
  [[nodiscard]] int evaluations() const {
    const std::lock_guard lock(mutex_);
    return evaluations_;
  }

 private:
  mutable std::mutex mutex_;
  mutable std::stop_source stop_;
  int stop_at_;
  mutable int evaluations_ = 0;
};

/// A cost whose numbers are broken.
class BrokenCost final : public StateCost {
 public:
  [[nodiscard]] std::string_view name() const noexcept override { return "broken"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch&, const CostBatch& out, Scratch&) const override {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::fill(out.residuals.begin(), out.residuals.end(), nan);
    std::fill(out.jacobian_q.begin(), out.jacobian_q.end(), nan);
    std::fill(out.jacobian_qdot.begin(), out.jacobian_qdot.end(), nan);
  }
};

class OptimiserConformance : public testing::TestWithParam<OptimiserCase> {
 protected:
  std::shared_ptr<Optimiser> optimiser_ = GetParam().make();

  void expect_invalid(const Problem& problem, const Trajectory& initial) {
    const auto solution = optimiser_->solve(problem, initial, Deadline());
    ASSERT_FALSE(solution.has_value());
    EXPECT_EQ(solution.error().code, ErrorCode::kInvalidArgument);
    EXPECT_FALSE(solution.error().message.empty());
  }
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(OptimiserConformance);

TEST_P(OptimiserConformance, ReachesTheGoalClearOfTheObstacle) {
  const Problem problem = reference_problem();
  ASSERT_LT(clearance_m(problem, straight_line_of(problem)), 0.0);
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
  EXPECT_GT(clearance_m(problem, solution->trajectory), 0.0);
}

TEST_P(OptimiserConformance, LowersTheCostAndAccountsForIt) {
  if (!GetParam().minimises_cost) GTEST_SKIP() << "a sampling planner";
  const Problem problem = reference_problem();
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  EXPECT_LT(solution->cost, solution->initial_cost);
  double sum = 0.0;
  bool has_prior = false;
  for (const TermCost& term : solution->terms) {
    EXPECT_GE(term.cost, 0.0) << term.name;
    sum += term.cost;
    has_prior = has_prior || term.name == "gp_prior";
  }
  EXPECT_TRUE(has_prior);
  EXPECT_NEAR(sum, solution->cost, 1e-9 * (1.0 + solution->cost));
}

TEST_P(OptimiserConformance, RepeatsItself) {
  if (!GetParam().repeatable) GTEST_SKIP() << "keeps random state in the process";
  const Problem problem = reference_problem();
  const auto first = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  const auto second = GetParam().make()->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(first.has_value() && second.has_value());
  EXPECT_EQ(first->trajectory.times_s, second->trajectory.times_s);
  EXPECT_EQ(first->trajectory.positions, second->trajectory.positions);
  EXPECT_EQ(first->trajectory.velocities, second->trajectory.velocities);
  EXPECT_EQ(first->iterations, second->iterations);
  EXPECT_EQ(first->cost, second->cost);
}

TEST_P(OptimiserConformance, SolvesAnotherProblemAfterTheFirst) {
  Problem problem = reference_problem();
  ASSERT_TRUE(optimiser_->solve(problem, straight_line_of(problem), Deadline()).has_value());
  problem.robot = std::make_shared<PlanarRobot>(PlanarRobot::Shape{1, true});
  problem.start = {Eigen::Vector3d(0.0, 0.0, 1.0), Eigen::Vector3d::Zero()};
  problem.goal = {Eigen::Vector3d(0.5, -1.0, 0.5), Eigen::Vector3d::Zero()};
  problem.qc = Eigen::Vector3d::Ones();
  problem.support_states = 9;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
}

TEST_P(OptimiserConformance, StaysWhereItIs) {
  Problem problem = reference_problem();
  problem.goal = problem.start;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
}

TEST_P(OptimiserConformance, SolvesTheShortestProblem) {
  Problem problem = reference_problem();
  problem.goal.q = problem.start.q + Eigen::Vector4d(-0.2, -0.1, 0.1, 0.1);
  problem.support_states = 3;
  problem.interpolated_checks = 0;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
}

TEST_P(OptimiserConformance, ReturnsAtAnExpiredDeadline) {
  const Problem problem = reference_problem();
  const auto solution =
      optimiser_->solve(problem, straight_line_of(problem), Deadline::after_s(0.0));
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_well_formed(problem, *solution);
  EXPECT_EQ(solution->status, SolveStatus::kDeadline);
}

TEST_P(OptimiserConformance, StopsWithinOneIterationWhenAsked) {
  if (!GetParam().minimises_cost) GTEST_SKIP() << "a sampling planner";
  Problem problem = reference_problem();
  std::stop_source stop;
  const auto stopping = std::make_shared<StoppingCost>(stop, 4);
  problem.terms.push_back({stopping, Placement::kSupport});
  const auto solution =
      optimiser_->solve(problem, straight_line_of(problem), Deadline(stop.get_token()));
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_well_formed(problem, *solution);
  EXPECT_EQ(solution->status, SolveStatus::kDeadline);
  EXPECT_LE(stopping->evaluations(), 4 + 3);  // an iteration evaluates residuals and Jacobians
  EXPECT_GE(solution->trajectory.size(), 2);
  EXPECT_LE(solution->cost, solution->initial_cost);
}

TEST_P(OptimiserConformance, RefusesAStartThatIsNotANumber) {
  Problem problem = reference_problem();
  const Trajectory initial = straight_line_of(problem);
  problem.start.q[1] = std::numeric_limits<double>::quiet_NaN();
  expect_invalid(problem, initial);
}

TEST_P(OptimiserConformance, RefusesAGoalBeyondItsLimits) {
  Problem problem = reference_problem();
  problem.goal.q[2] = 3.5;
  expect_invalid(problem, straight_line_of(problem));
}

TEST_P(OptimiserConformance, RefusesAStateOfTheWrongSize) {
  Problem problem = reference_problem();
  const Trajectory initial = straight_line_of(problem);
  problem.goal.q = Eigen::Vector3d::Zero();
  expect_invalid(problem, initial);
}

TEST_P(OptimiserConformance, RefusesWhatMakesNoSense) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const std::pair<const char*, std::function<void(Problem&)>> changes[] = {
      {"two states", [](Problem& p) { p.support_states = 2; }},
      {"no state", [](Problem& p) { p.support_states = 0; }},
      {"no time", [](Problem& p) { p.dt_s = 0.0; }},
      {"no number of a time", [&](Problem& p) { p.dt_s = nan; }},
      {"endless time", [&](Problem& p) { p.dt_s = infinity; }},
      {"qc of zero", [](Problem& p) { p.qc[1] = 0.0; }},
      {"negative qc", [](Problem& p) { p.qc[3] = -1.0; }},
      {"qc that is not a number", [&](Problem& p) { p.qc[0] = nan; }},
      {"qc of other joints", [](Problem& p) { p.qc.conservativeResize(3); }},
      {"no speed", [](Problem& p) { p.speed_fraction = 0.0; }},
      {"a joint that must not move",
       [](Problem& p) {
         p.robot = std::make_shared<PlanarRobot>(
             PlanarRobot::Shape{.rotary_joints = 2, .mobile = true, .fastest_radps = 0.0});
       }},
      {"a term that is missing", [](Problem& p) { p.terms.push_back({}); }},
      {"no robot", [](Problem& p) { p.robot = nullptr; }}};
  const Trajectory initial = straight_line_of(reference_problem());
  for (const auto& [what, change] : changes) {
    SCOPED_TRACE(what);
    Problem problem = reference_problem();
    change(problem);
    expect_invalid(problem, initial);
  }
}

TEST_P(OptimiserConformance, HoldsAJointWhoseLimitsAreOne) {
  Problem problem = reference_problem();
  problem.robot = std::make_shared<PlanarRobot>(
      PlanarRobot::Shape{.rotary_joints = 2, .mobile = true, .range_rad = 0.0});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{1.0, 2.0, 0.0}, 0.25}});
  problem.start.q << 0.0, 0.0, 0.0, 0.0;
  problem.goal.q << 1.5, 0.1, 0.0, 0.0;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
  for (int i = 0; i < solution->trajectory.size(); ++i) {
    for (int j = 2; j < 4; ++j) {
      EXPECT_NEAR(solution->trajectory.q(i)[static_cast<std::size_t>(j)], 0.0, 1e-3);
    }
  }
}

TEST_P(OptimiserConformance, AnswersWhateverThePriorWeighs) {
  if (!GetParam().minimises_cost) GTEST_SKIP() << "a sampling planner";
  for (const double qc : {1e-300, 1e-30, 1e-9, 1e9, 1e30, 1e300}) {
    for (const double dt_s : {1e-9, 0.4, 1e9}) {
      SCOPED_TRACE("qc " + std::to_string(std::log10(qc)) + ", dt " + std::to_string(dt_s));
      Problem problem = reference_problem();
      problem.qc.setConstant(qc);
      problem.qc[1] = 1.0;
      problem.dt_s = dt_s;
      const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
      ASSERT_TRUE(solution.has_value()) << solution.error().describe();
      expect_well_formed(problem, *solution);
    }
  }
}

TEST_P(OptimiserConformance, AnswersWhereEverythingIsInCollision) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{1.0, 0.2, 0.0}, 50.0}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_well_formed(problem, *solution);
  if (!GetParam().minimises_cost) {
    EXPECT_EQ(solution->status, SolveStatus::kNoPath);
  }
}

TEST_P(OptimiserConformance, AnswersWhereNothingHasBeenSeen) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<BallField>(std::vector<Ball>{}, 8.0, -9.0);
  for (const Space unknown : {Space::kFree, Space::kOccupied}) {
    problem.space.unknown = unknown;
    problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
    const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
    ASSERT_TRUE(solution.has_value()) << solution.error().describe();
    expect_well_formed(problem, *solution);
    if (unknown == Space::kFree) expect_reaches_goal(problem, *solution);
  }
}

TEST_P(OptimiserConformance, KeepsAboveTheFloor) {
  // The arm swings through beneath its base, where it is longer than the base is high.
  Problem problem = reference_problem();
  problem.robot = std::make_shared<PlanarRobot>(
      PlanarRobot::Shape{.rotary_joints = 2, .mobile = true, .upright = true});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{});
  problem.space.floor = Floor{-0.5, {}};
  problem.start.q = Eigen::Vector4d(0.0, 0.0, -0.2, 0.0);
  problem.goal.q = Eigen::Vector4d(0.0, 0.0, -2.7, 0.0);
  problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
  ASSERT_LT(height_m(problem, straight_line_of(problem)), -0.6);  // outermost sphere: 0.55 m away
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
  EXPECT_GT(height_m(problem, solution->trajectory), -0.5);
}

TEST_P(OptimiserConformance, AnswersWhereTheGoalIsOutsideTheGrid) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<BallField>(std::vector<Ball>{}, 1.0);
  for (const Space outside : {Space::kFree, Space::kOccupied}) {
    problem.space.outside = outside;
    problem.terms = standard_terms(problem, {.epsilon_m = 0.1});
    const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
    ASSERT_TRUE(solution.has_value()) << solution.error().describe();
    expect_well_formed(problem, *solution);
    if (outside == Space::kFree) {
      expect_reaches_goal(problem, *solution);
    } else if (!GetParam().minimises_cost) {
      EXPECT_EQ(solution->status, SolveStatus::kNoPath);
    }
  }
}

TEST_P(OptimiserConformance, HoldsStartAndGoalWithoutAnyTerm) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<BallField>(std::vector<Ball>{});
  problem.terms.clear();
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_reaches_goal(problem, *solution);
}

TEST_P(OptimiserConformance, RefusesAnInitialTrajectoryThatDoesNotFit) {
  if (!GetParam().minimises_cost) GTEST_SKIP() << "a sampling planner";
  const Problem problem = reference_problem();
  expect_invalid(problem, make_trajectory(4, problem.support_states + 1, problem.dt_s));
  expect_invalid(problem, make_trajectory(3, problem.support_states, problem.dt_s));
  expect_invalid(problem, Trajectory{});
  Trajectory broken = straight_line_of(problem);
  broken.positions[5] = std::numeric_limits<double>::quiet_NaN();
  expect_invalid(problem, broken);
}

TEST_P(OptimiserConformance, SurvivesAStartInsideAnObstacle) {
  Problem problem = reference_problem();
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, 0.05, 0.0}, 0.4}});
  problem.terms = standard_terms(problem, {});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_well_formed(problem, *solution);
}

TEST_P(OptimiserConformance, NamesACostThatIsNotANumber) {
  if (!GetParam().minimises_cost) GTEST_SKIP() << "a sampling planner";
  Problem problem = reference_problem();
  problem.terms.push_back({std::make_shared<BrokenCost>(), Placement::kSupportAndInterpolated});
  const auto solution = optimiser_->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(solution.has_value()) << solution.error().describe();
  expect_well_formed(problem, *solution);
  EXPECT_EQ(solution->status, SolveStatus::kFailed);
  EXPECT_NE(solution->reason.find("broken"), std::string::npos) << solution->reason;
}

}  // namespace sidestep::conformance
