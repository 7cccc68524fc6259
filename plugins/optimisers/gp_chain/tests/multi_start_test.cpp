#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/goal.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/problems/recorded_problems.hpp>

#include "conformance/optimiser_conformance.hpp"
#include "support/chain_robot.hpp"

#include "gp_chain.hpp"
#include "prior_chain.hpp"

namespace sidestep {
namespace {

using conformance::reference_problem;
using conformance::straight_line_of;

/// A Wiener velocity pinned at both ends of [0, T]: its position strays by q t^3 (T - t)^3 / (3
/// T^3) in the mean square (Q(t) conditioned on the end; GPMP2, section 4).
TEST(PriorSampler, StraysAsAPinnedWienerVelocity) {
  Problem problem = reference_problem();
  problem.qc << 1.0, 0.25, 4.0, 1.0;
  PriorSampler sampler;
  sampler.reset(problem);
  const int n = problem.support_states;
  constexpr int kDof = 4, kDraws = 20000;
  std::vector<double> draw(static_cast<std::size_t>(n * 2 * kDof));
  std::vector<double> sums(draw.size()), squares(draw.size());
  for (int i = 0; i < kDraws; ++i) {
    sampler.draw(static_cast<std::uint64_t>(i), draw);
    for (std::size_t v = 0; v < draw.size(); ++v) {
      sums[v] += draw[v];
      squares[v] += draw[v] * draw[v];
    }
  }
  const double T = (n - 1) * problem.dt_s;
  for (int i = 0; i < n; ++i) {
    const double t = i * problem.dt_s;
    const double rest = t * (T - t) / T;
    for (int j = 0; j < kDof; ++j) {
      const auto v = static_cast<std::size_t>(i * 2 * kDof + j);
      const double expected = problem.qc[j] * rest * rest * rest / 3.0;
      EXPECT_NEAR(squares[v] / kDraws, expected, 0.06 * expected + 1e-12) << "state " << i;
      EXPECT_NEAR(sums[v] / kDraws, 0.0, 0.05 * std::sqrt(expected) + 1e-12) << "state " << i;
    }
  }
}

TEST(PriorSampler, DrawsTheSameForTheSameSeed) {
  PriorSampler a, b;
  a.reset(reference_problem());
  b.reset(reference_problem());
  std::vector<double> first(15 * 8), again(15 * 8), other(15 * 8);
  a.draw(7, first);
  b.draw(8, other);
  b.draw(7, again);
  EXPECT_EQ(first, again);
  EXPECT_NE(first, other);
}

TEST(MultiStart, FindsTheSameWithAndWithoutThreads) {
  const Problem problem = reference_problem();
  WorkerPool workers(3);
  for (const char* accept : {"best_valid", "first_valid"}) {
    const GpChainSettings settings{.starts = 6, .accept = accept};
    const auto alone =
        make_gp_chain(settings)->solve(problem, straight_line_of(problem), Deadline());
    const auto shared =
        make_gp_chain(settings, &workers)->solve(problem, straight_line_of(problem), Deadline());
    ASSERT_TRUE(alone.has_value() && shared.has_value());
    EXPECT_EQ(alone->trajectory.positions, shared->trajectory.positions) << accept;
    EXPECT_EQ(alone->cost, shared->cost) << accept;
  }
}

TEST(MultiStart, IsNeverDearerThanOneStartThatIsValid) {
  const Problem problem = reference_problem();
  const auto one = make_gp_chain({})->solve(problem, straight_line_of(problem), Deadline());
  const auto many =
      make_gp_chain({.starts = 8})->solve(problem, straight_line_of(problem), Deadline());
  ASSERT_TRUE(one.has_value() && many.has_value());
  ASSERT_GT(conformance::clearance_m(problem, one->trajectory), 0.0);
  EXPECT_LE(many->cost, one->cost);
  EXPECT_GT(conformance::clearance_m(problem, many->trajectory), 0.0);
}

/// Counts how often it is asked, and costs nothing.
class Counter final : public StateCost {
 public:
  explicit Counter(std::shared_ptr<std::atomic<int>> asked) : asked_(std::move(asked)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "counter"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch&, const CostBatch& out, Scratch&) const override {
    ++*asked_;
    std::ranges::fill(out.residuals, 0.0);
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
  }

 private:
  std::shared_ptr<std::atomic<int>> asked_;
};

TEST(MultiStart, DoesNotSettleForAStartThatMissesTheGoal) {
  Problem problem;
  problem.robot = testing_support::mobile_arm();
  problem.field = std::make_shared<conformance::BallField>(
      std::vector<conformance::Ball>{{{0.0, 0.0, 9.0}, 0.1}});
  problem.start = {Eigen::VectorXd::Zero(7), Eigen::VectorXd::Zero(7)};
  problem.start.q << 0.0, 0.0, 0.3, 0.1, -0.6, 0.9, 0.2;
  problem.goal = problem.start;
  problem.support_states = 11;
  problem.dt_s = 0.3;
  problem.qc = Eigen::VectorXd::Ones(7);
  const auto asked = std::make_shared<std::atomic<int>>(0);
  /// How often costs were evaluated on the way to a hand at some height.
  const auto solve = [&](double height_m, int starts) {
    problem.terms = standard_terms(problem, {.sigma_self_collision = 0.0, .hold_goal = false});
    auto there = make_link_position_cost(problem.robot, "hand", {0.8, 0.2, height_m}, 1e-3);
    EXPECT_TRUE(there) << there.error().describe();
    problem.terms.push_back({std::move(*there), Placement::kGoal});
    problem.terms.push_back({std::make_shared<Counter>(asked), Placement::kSupport});
    *asked = 0;
    const auto solution = make_gp_chain({.starts = starts, .accept = "first_valid"})
                              ->solve(problem, straight_line_of(problem), Deadline());
    EXPECT_TRUE(solution) << solution.error().describe();
    const auto check = make_field_check(problem.robot, problem.field, problem.space,
                                        {.speed_fraction = 1e9, .limit_tolerance = 1.0});
    EXPECT_TRUE(check->check(solution->trajectory, 0.0, {})->valid()) << "nothing is in the way";
    const auto end = solution->trajectory.q(solution->trajectory.size() - 1);
    EXPECT_EQ(goal_miss(problem, end).empty(), height_m < 1.0);
    return asked->load();
  };
  EXPECT_EQ(solve(0.9, 4), solve(0.9, 1)) << "the first start reaches the goal";
  EXPECT_GT(solve(1.9, 4), 2 * solve(1.9, 1)) << "no start does, but all are to be tried";
}

/// Where GPMP2's straight line runs into a local minimum, another start should find a way: of the
/// cluttered problems whose ends are free.
TEST(MultiStart, FindsWaysThroughClutter) {
  const auto file =
      std::filesystem::path(SIDESTEP_SHARED_DATA) / "gpmp2" / "problems_panda_clutter.json";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no recorded problems in " << file;
  const auto problems = read_recorded_problems(file);
  ASSERT_TRUE(problems) << problems.error().describe();
  std::vector<std::shared_ptr<const DistanceField>> fields;
  for (std::size_t scene = 0; scene < problems->scenes.size(); ++scene) {
    fields.push_back(recorded_field(*problems, static_cast<int>(scene), true));
  }
  const auto one = make_gp_chain({}), many = make_gp_chain({.starts = 8});
  int count = 0, one_free = 0, many_free = 0;
  for (const RecordedRun& run : problems->runs) {
    if (run.label != "study" || !run.is_signed) continue;
    for (const RecordedOutcome& peer : run.outcomes) {
      const auto& field = fields[static_cast<std::size_t>(peer.scene)];
      const Problem problem = recorded_problem(*problems, field, peer.pair);
      const Trajectory initial = recorded_initial(*problems, problem);
      const auto is_free = [&](const std::unique_ptr<Optimiser>& optimiser) {
        const auto solution = optimiser->solve(problem, initial, Deadline());
        return solution && clearance_at_checks_m(problem, *field, solution->trajectory) > 0.0;
      };
      const auto stays_free = [&](const RobotState& at) {
        const Trajectory rest = straight_line(at, at, problem.support_states, problem.dt_s);
        return clearance_at_checks_m(problem, *field, rest) > 0.0;
      };
      if (!stays_free(problem.start) || !stays_free(problem.goal)) continue;
      ++count;
      one_free += is_free(one);
      many_free += is_free(many);
    }
  }
  RecordProperty("problems", count);
  RecordProperty("one_free", one_free);
  RecordProperty("many_free", many_free);
  EXPECT_GE(many_free, one_free);
  EXPECT_GE(many_free, 0.995 * count);
}

}  // namespace
}  // namespace sidestep
