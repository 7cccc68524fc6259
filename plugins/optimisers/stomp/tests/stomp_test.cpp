#include "stomp.hpp"

#include <gtest/gtest.h>

#include "conformance/optimiser_conformance.hpp"
#include "support/waypoint_expectations.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;

/// Occupied or free, and nothing else: within the balls the distance is 0, elsewhere far, and there
/// is no gradient. Fails the test if one is asked for.
class OccupancyField final : public DistanceField {
 public:
  explicit OccupancyField(std::vector<Ball> balls)
      : DistanceField(BallField({}).info()), balls_(std::move(balls)) {}

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override {
    EXPECT_TRUE(gradients.empty()) << "a derivative is asked for";
    std::ranges::fill(gradients, Eigen::Vector3d::Zero());
    std::ranges::fill(statuses, FieldStatus::kKnown);
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      const bool is_occupied = std::ranges::any_of(balls_, [&](const Ball& ball) {
        return (points_m[i] - ball.centre_m).norm() < ball.radius_m;
      });
      distances_m[i] = is_occupied ? 0.0 : 10.0;
    }
  }

 private:
  std::vector<Ball> balls_;
};

Problem blocked_problem() {
  Problem problem = problem_with_a_ball();
  problem.interpolated_checks = 1;
  problem.terms = standard_terms(problem, {.epsilon_m = 0.05, .sigma_obstacle = 0.01});
  return problem;
}

Solution stomp_solution(const Problem& problem, const StompSettings& settings,
                        std::uint64_t seed = 1, WorkerPool* workers = nullptr) {
  const auto solution = make_stomp(settings, workers, seed)
                            ->solve(problem, conformance::straight_line_of(problem), Deadline());
  EXPECT_TRUE(solution.has_value());
  return solution.value_or(Solution{});
}

TEST(Stomp, PassesABallWhateverTheSeed) {
  const Problem problem = blocked_problem();
  const double shortest_m = shortest_around({-1.0, 0.0}, {1.0, 0.0}, {0.0, 0.1}, 0.4);
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    const Solution solution = stomp_solution(problem, {}, seed);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
    EXPECT_GT(conformance::clearance_m(problem, solution.trajectory), 0.0) << "seed " << seed;
    EXPECT_GT(length_m(solution.trajectory), shortest_m - 1e-3) << "seed " << seed;
    EXPECT_LT(length_m(solution.trajectory), 1.5 * shortest_m) << "seed " << seed;
  }
}

/// With obstacles grown by the disc's radius and 2 cm; the path is judged by the true distances.
TEST(Stomp, PlansThroughBinaryOccupancy) {
  Problem problem = blocked_problem();
  const auto truth = problem.field;
  problem.field = std::make_shared<OccupancyField>(
      std::vector<Ball>{{{0.0, 0.1, 0.0}, 0.25 + kDiscRadius_m + 0.02}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.05, .sigma_obstacle = 0.01});
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const Solution solution = stomp_solution(problem, {}, seed);
    ASSERT_EQ(solution.status, SolveStatus::kConverged) << solution.reason;
    Problem judged = problem;
    judged.field = truth;
    EXPECT_LT(conformance::clearance_m(judged, conformance::straight_line_of(problem)), 0.0);
    EXPECT_GT(conformance::clearance_m(judged, solution.trajectory), 0.0) << "seed " << seed;
  }
}

TEST(Stomp, FindsTheSameWithAnyNumberOfThreads) {
  const Problem problem = blocked_problem();
  WorkerPool one(1), three(3);
  const Solution alone = stomp_solution(problem, {.max_iterations = 40}, 5);
  for (WorkerPool* workers : {&one, &three}) {
    const Solution shared = stomp_solution(problem, {.max_iterations = 40}, 5, workers);
    EXPECT_EQ(alone.trajectory.positions, shared.trajectory.positions);
    EXPECT_EQ(alone.cost, shared.cost);
  }
}

TEST(Stomp, FindsAnotherPathWithAnotherSeed) {
  const Problem problem = blocked_problem();
  EXPECT_NE(stomp_solution(problem, {.max_iterations = 5}, 1).trajectory.positions,
            stomp_solution(problem, {.max_iterations = 5}, 2).trajectory.positions);
}

TEST(Stomp, KeepsJointLimitsInEveryRollout) {
  /// Notes the lowest position that it is asked about.
  class Watch final : public StateCost {
   public:
    [[nodiscard]] std::string_view name() const noexcept override { return "watch"; }
    [[nodiscard]] int residual_count() const noexcept override { return 1; }
    [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
    void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
      EXPECT_TRUE(out.jacobian_q.empty());
      EXPECT_TRUE(out.jacobian_qdot.empty());
      std::ranges::fill(out.residuals, 0.0);
      for (std::size_t i = 1; i < states.q.size(); i += 2) lowest = std::min(lowest, states.q[i]);
    }
    mutable double lowest = 0.0;  // one thread only
  };
  Problem problem = disc_problem(41, {-1.0, -4.6}, {1.0, -4.6});
  problem.field = std::make_shared<BallField>(std::vector<Ball>{{{0.0, -4.4, 0.0}, 0.25}});
  problem.terms = standard_terms(problem, {.epsilon_m = 0.05, .sigma_obstacle = 0.01});
  const auto watch = std::make_shared<Watch>();
  problem.terms.push_back({watch, Placement::kSupport});
  (void)stomp_solution(problem, {.noise_s = 0.5});
  EXPECT_GE(watch->lowest, -4.99);
  EXPECT_LT(watch->lowest, -4.98);
}

TEST(Stomp, SaysThatItRanOutOfIterations) {
  expect_iteration_limit(stomp_solution(blocked_problem(), {.max_iterations = 3}), 3);
}

TEST(Stomp, ReachesAGoalThatOnlyCostsKnow) {
  expect_free_goal_is_reached([](const Problem& problem) { return stomp_solution(problem, {}); });
}

TEST(StompSettings, MustLeaveSomethingNewToTry) {
  EXPECT_TRUE(StompSettings{}.check().empty());
  EXPECT_EQ((StompSettings{.rollouts = 5, .reused = 5}.check().size()), 1u);
}

}  // namespace
}  // namespace sidestep
