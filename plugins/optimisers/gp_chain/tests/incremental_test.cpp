#include <functional>
#include <numeric>
#include <stdexcept>

#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "conformance/optimiser_conformance.hpp"
#include "gp_chain.hpp"
#include "support/joint_cost.hpp"

namespace sidestep {
namespace {

using conformance::Ball;
using conformance::BallField;
using conformance::reference_problem;
using conformance::straight_line_of;

constexpr double kSigmaEnd = 1e-4;

void expect_equal(const Solution& a, const Solution& b) {
  EXPECT_EQ(a.trajectory.positions, b.trajectory.positions);
  EXPECT_EQ(a.trajectory.velocities, b.trajectory.velocities);
  EXPECT_EQ(a.initial_cost, b.initial_cost);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.iterations, b.iterations);
}

Solution solved(Optimiser& optimiser, const Problem& problem, const Trajectory& initial) {
  auto solution = optimiser.solve(problem, initial, Deadline());
  if (!solution) throw std::runtime_error(solution.error().describe());
  return *std::move(solution);
}

void replace_term(Problem& problem, Placement placement, std::shared_ptr<const StateCost> cost) {
  for (CostTerm& term : problem.terms) {
    if (term.placement == placement) term.cost = cost;
  }
}

Problem with_goal(Problem problem, const Eigen::Vector4d& by) {
  problem.goal.q += by;
  replace_term(problem, Placement::kGoal, make_state_prior("goal", problem.goal, kSigmaEnd));
  return problem;
}

Problem with_start(Problem problem, const Eigen::Vector4d& by) {
  problem.start.q += by;
  replace_term(problem, Placement::kStart, make_state_prior("start", problem.start, kSigmaEnd));
  return problem;
}

Problem with_field(Problem problem, const Ball& ball) {
  problem.field = std::make_shared<BallField>(std::vector<Ball>{ball});
  for (CostTerm& term : problem.terms) {
    if (term.cost->name() != "obstacle") continue;
    term.cost = make_obstacle_cost(problem.robot, problem.field, problem.space, 0.2, 0.05);
  }
  return problem;
}

/// Quadratic: a prior, ends, a posture on the way.
Problem linear_problem() {
  Problem problem = reference_problem();
  problem.terms = {{make_state_prior("start", problem.start, 0.01), Placement::kStart},
                   {make_state_prior("goal", problem.goal, 0.01), Placement::kGoal},
                   {make_state_prior("rest", problem.start, 3.0), Placement::kSupport}};
  return problem;
}

const Eigen::Vector4d kBy(0.1, -0.05, 0.08, 0.12);

/// A change, and whether all it leaves to be evaluated again is a state at an end.
struct Change {
  std::string name;
  std::function<Problem(const Problem&)> make;

  friend std::ostream& operator<<(std::ostream& out, const Change& c) { return out << c.name; }
};

const std::vector<Change> kChanges = {
    {"nothing", [](const Problem& p) { return p; }},
    {"goal", [](const Problem& p) { return with_goal(p, kBy); }},
    {"start", [](const Problem& p) { return with_start(p, kBy); }},
    {"both", [](const Problem& p) { return with_start(with_goal(p, kBy), -kBy); }},
    {"field",
     [](const Problem& p) {
       return with_field(p, {{1.0, 0.05, 0.0}, 0.25});
     }},
    {"field_and_goal", [](const Problem& p) {
       return with_field(with_goal(p, kBy), {{0.9, 0.2, 0.0}, 0.3});
     }}};

class Incremental : public testing::Test {
 protected:
  GpChainSettings settings_{.relative_tolerance = 1e-9, .absolute_tolerance = 1e-9};
  std::unique_ptr<Optimiser> fresh_ = make_gp_chain(settings_);
  std::unique_ptr<Optimiser> kept_ = [this] {
    GpChainSettings settings = settings_;
    settings.incremental = true;
    return make_gp_chain(settings);
  }();
};

class IncrementalChange : public Incremental, public testing::WithParamInterface<Change> {};

/// Costs are those of the trajectories, whatever they have been put together from: another
/// optimiser evaluates all of both.
TEST_P(IncrementalChange, KnowsTheCostsExactly) {
  const Problem before = reference_problem();
  const Problem after = GetParam().make(before);
  const Solution first = solved(*kept_, before, straight_line_of(before));
  const Solution second = solved(*kept_, after, first.trajectory);
  const Solution warm = solved(*fresh_, after, first.trajectory);
  const Solution again = solved(*fresh_, after, second.trajectory);
  EXPECT_NEAR(second.initial_cost, warm.initial_cost, 1e-9 * warm.initial_cost);
  EXPECT_NEAR(second.cost, again.initial_cost, 1e-9 * second.cost);
  double sum = 0.0;
  ASSERT_EQ(second.terms.size(), after.terms.size() + 1);
  for (const TermCost& term : second.terms) sum += term.cost;
  EXPECT_NEAR(sum, second.cost, 1e-12 * sum);
  EXPECT_EQ(second.status, SolveStatus::kConverged);
}

TEST_P(IncrementalChange, FindsTheMinimumThatAWarmSolveFinds) {
  const Problem before = reference_problem();
  const Problem after = GetParam().make(before);
  const Solution first = solved(*kept_, before, straight_line_of(before));
  const Solution second = solved(*kept_, after, first.trajectory);
  const Solution warm = solved(*fresh_, after, first.trajectory);
  EXPECT_NEAR(second.cost, warm.cost, 1e-6 * warm.cost);
  for (std::size_t v = 0; v < warm.trajectory.positions.size(); ++v) {
    EXPECT_NEAR(second.trajectory.positions[v], warm.trajectory.positions[v], 1e-3);
  }
  EXPECT_GT(conformance::clearance_m(after, second.trajectory), 0.0);
}

/// One Gauss-Newton step is exact there, and is known to be the last.
TEST_P(IncrementalChange, SolvesALinearProblemInOneStep) {
  const Problem before = linear_problem();
  const Problem after = GetParam().make(before);
  const Solution first = solved(*kept_, before, straight_line_of(before));
  const Solution second = solved(*kept_, after, first.trajectory);
  const bool changes_cost = GetParam().name != "nothing" && GetParam().name != "field";
  EXPECT_EQ(second.iterations, changes_cost ? 1 : 0);
  const Solution afresh = solved(*fresh_, after, straight_line_of(after));
  EXPECT_NEAR(second.cost, afresh.cost, 1e-8);
  for (std::size_t v = 0; v < afresh.trajectory.positions.size(); ++v) {
    EXPECT_NEAR(second.trajectory.positions[v], afresh.trajectory.positions[v], 1e-5);
    EXPECT_NEAR(second.trajectory.velocities[v], afresh.trajectory.velocities[v], 1e-5);
  }
}

TEST_P(IncrementalChange, DoesTheSameAfterTheSame) {
  const Problem before = reference_problem();
  const Problem after = GetParam().make(before);
  GpChainSettings settings = settings_;
  settings.incremental = true;
  const auto other = make_gp_chain(settings);
  const Solution first = solved(*kept_, before, straight_line_of(before));
  const Solution second = solved(*kept_, after, first.trajectory);
  (void)solved(*other, before, straight_line_of(before));
  expect_equal(second, solved(*other, after, first.trajectory));
}

INSTANTIATE_TEST_SUITE_P(GpChain, IncrementalChange, testing::ValuesIn(kChanges),
                         [](const auto& of) { return of.param.name; });

/// The cubic through the new ends is known in closed form: held ends, with no cost along the way.
TEST_F(Incremental, SpreadsTheChangeOfHeldEnds) {
  Problem problem = reference_problem();
  problem.terms.clear();
  const Solution first = solved(*kept_, problem, straight_line_of(problem));
  problem.goal.q += kBy;
  problem.start.qdot -= kBy;
  const Solution second = solved(*kept_, problem, first.trajectory);
  EXPECT_EQ(second.iterations, 1);
  const double duration_s = (problem.support_states - 1) * problem.dt_s;
  const Trajectory cubic = straight_line(problem.start, problem.goal, 2, duration_s);
  std::vector<double> q(4), qdot(4);
  for (int i = 0; i < problem.support_states; ++i) {
    cubic.sample(problem.dt_s * i, q, qdot);
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_NEAR(second.trajectory.q(i)[j], q[j], 1e-9) << "state " << i;
      EXPECT_NEAR(second.trajectory.qdot(i)[j], qdot[j], 1e-9) << "state " << i;
    }
  }
}

/// What leads on from nothing is solved as if nothing had been kept.
struct Mismatch {
  std::string name;
  std::function<void(Problem&)> change;
};

class IncrementalMismatch : public testing::TestWithParam<Mismatch> {};

TEST_P(IncrementalMismatch, IsSolvedAfresh) {
  const auto kept = make_gp_chain({.incremental = true});
  const auto fresh = make_gp_chain({});
  const Problem before = reference_problem();
  (void)solved(*kept, before, straight_line_of(before));
  Problem after = before;
  GetParam().change(after);
  const Solution solution = solved(*kept, after, straight_line_of(after));
  expect_equal(solution, solved(*fresh, after, straight_line_of(after)));
  const Solution next = solved(*kept, after, solution.trajectory);
  EXPECT_EQ(next.iterations, 0) << "leads on from what it was given last";
  EXPECT_EQ(next.trajectory.positions, solution.trajectory.positions);
}

INSTANTIATE_TEST_SUITE_P(
    GpChain, IncrementalMismatch,
    testing::Values(Mismatch{"initial_trajectory", [](Problem&) {}},
                    Mismatch{"robot",
                             [](Problem& p) {
                               p.robot = std::make_shared<conformance::PlanarRobot>(
                                   conformance::PlanarRobot::Shape{2, true, 4});
                               p.terms = standard_terms(p, {.epsilon_m = 0.2});
                             }},
                    Mismatch{"dof",
                             [](Problem& p) {
                               p.robot = std::make_shared<conformance::PlanarRobot>(
                                   conformance::PlanarRobot::Shape{1, true});
                               p.start = {p.start.q.head(3), p.start.qdot.head(3)};
                               p.goal = {p.goal.q.head(3), p.goal.qdot.head(3)};
                               p.qc.conservativeResize(3);
                               p.terms = standard_terms(p, {.epsilon_m = 0.2});
                             }},
                    Mismatch{"states", [](Problem& p) { p.support_states = 12; }},
                    Mismatch{"checks", [](Problem& p) { p.interpolated_checks = 3; }},
                    Mismatch{"dt", [](Problem& p) { p.dt_s = 0.5; }},
                    Mismatch{"qc", [](Problem& p) { p.qc[1] = 0.5; }},
                    Mismatch{"fewer_terms", [](Problem& p) { p.terms.pop_back(); }},
                    Mismatch{"placement",
                             [](Problem& p) { p.terms.front().placement = Placement::kSupport; }}),
    [](const auto& of) { return of.param.name; });

/// Tells how many states it is asked about, and throws or returns NaN where that is wanted.
class ProbeCost final : public StateCost {
 public:
  explicit ProbeCost(std::vector<int>& seen) : seen_(seen) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "probe"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch&) const override {
    seen_.push_back(states.count);
    if (throws) throw std::runtime_error("out of order");
    std::ranges::fill(out.residuals, residual);
    std::ranges::fill(out.jacobian_q, 0.0);
  }

  bool throws = false;
  double residual = 0.5;

 private:
  std::vector<int>& seen_;
};

TEST_F(Incremental, EvaluatesOneStateOfAChainWhoseGoalChanges) {
  Problem problem = reference_problem();
  std::vector<int> seen;
  const auto probe = std::make_shared<ProbeCost>(seen);
  problem.terms.push_back({probe, Placement::kSupport});
  const Solution first = solved(*kept_, problem, straight_line_of(problem));
  seen.clear();
  const Solution second = solved(*kept_, with_goal(problem, kBy), first.trajectory);
  ASSERT_GE(second.iterations, 1);
  std::vector<int> expected(static_cast<std::size_t>(second.iterations) + 1, 15);
  expected.front() = 1;
  EXPECT_EQ(seen, expected);
  EXPECT_NEAR(second.terms.back().cost, 15 * 0.125, 1e-12) << "of all states";
}

TEST_F(Incremental, TakesNothingFromASolveThatBroke) {
  Problem problem = reference_problem();
  const Solution first = solved(*kept_, problem, straight_line_of(problem));

  std::vector<int> seen;
  const auto probe = std::make_shared<ProbeCost>(seen);
  Problem broken = problem;
  probe->residual = std::numeric_limits<double>::quiet_NaN();
  replace_term(broken, Placement::kGoal, probe);
  const Solution nan = solved(*kept_, broken, first.trajectory);
  EXPECT_EQ(nan.status, SolveStatus::kFailed);
  EXPECT_NE(nan.reason.find("probe"), std::string::npos) << nan.reason;
  EXPECT_EQ(nan.trajectory.size(), 0);
  expect_equal(solved(*kept_, problem, first.trajectory),
               solved(*fresh_, problem, first.trajectory));

  probe->throws = true;
  EXPECT_THROW((void)kept_->solve(broken, first.trajectory, Deadline()), std::runtime_error);
  expect_equal(solved(*kept_, problem, first.trajectory),
               solved(*fresh_, problem, first.trajectory));
}

TEST_F(Incremental, StopsAtTheDeadlineWithWhatItHasAndLeadsOnFromIt) {
  const Problem problem = reference_problem();
  const Solution first = solved(*kept_, problem, straight_line_of(problem));
  const Problem moved = with_goal(problem, kBy);
  std::stop_source stop;
  stop.request_stop();
  const auto stopped = kept_->solve(moved, first.trajectory, Deadline(stop.get_token()));
  ASSERT_TRUE(stopped.has_value());
  EXPECT_EQ(stopped->status, SolveStatus::kDeadline);
  EXPECT_EQ(stopped->trajectory.positions, first.trajectory.positions);
  const Solution after = solved(*kept_, moved, stopped->trajectory);
  const Solution warm = solved(*fresh_, moved, first.trajectory);
  EXPECT_NEAR(after.cost, warm.cost, 1e-6 * warm.cost);
}

/// The classic where Newton's steps diverge from afar.
std::shared_ptr<const StateCost> arcus_cost(double offset) {
  return std::make_shared<testing_support::JointCost>([offset](double q) {
    const double x = 10.0 * (q - offset);
    return testing_support::JointCost::Value{100.0 * std::atan(x), 1000.0 / (1.0 + x * x)};
  });
}

TEST_F(Incremental, FallsBackToDampedStepsWhereFullOnesGoTooFar) {
  Problem problem = reference_problem();
  problem.terms.push_back({arcus_cost(0.0), Placement::kSupport});
  const Solution first = solved(*kept_, problem, straight_line_of(problem));
  problem.terms.back().cost = arcus_cost(0.4);
  const Solution second = solved(*kept_, problem, first.trajectory);
  EXPECT_GT(second.iterations, second.accepted_iterations) << "a full step was refused";
  const Solution warm = solved(*fresh_, problem, first.trajectory);
  EXPECT_LT(second.cost, second.initial_cost);
  EXPECT_NEAR(second.cost, warm.cost, 1e-3 * warm.cost);
}

TEST_F(Incremental, CountsStepsOfBothKindsTowardsTheLimit) {
  const auto limited = make_gp_chain({.relative_tolerance = 0.0,
                                      .absolute_tolerance = 0.0,
                                      .max_iterations = 2,
                                      .incremental = true});
  const Problem problem = reference_problem();
  const Solution first = solved(*limited, problem, straight_line_of(problem));
  const Solution second = solved(
      *limited, with_field(with_goal(problem, kBy), {{0.9, 0.2, 0.0}, 0.3}), first.trajectory);
  EXPECT_EQ(second.status, SolveStatus::kIterationLimit);
  EXPECT_EQ(second.accepted_iterations, 2);
}

TEST(IncrementalSettings, SeveralStartsAreRefused) {
  EXPECT_TRUE((GpChainSettings{.incremental = true}).check().empty());
  EXPECT_TRUE((GpChainSettings{.starts = 8}).check().empty());
  const auto mistakes = (GpChainSettings{.starts = 8, .incremental = true}).check();
  ASSERT_EQ(mistakes.size(), 1u);
  EXPECT_EQ(mistakes.front().parameters.front(), "incremental");
}

}  // namespace
}  // namespace sidestep
