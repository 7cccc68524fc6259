#include <cmath>

#include <sidestep/trajectory/gp_prior.hpp>

#include "batch_problems.hpp"
#include "chain_scene.hpp"
#include "prior_chain.hpp"
#include "support/in_doubles.hpp"

namespace sidestep::gp_chain_cuda::test {
namespace {

/// The states of a problem at which a term applies, interpolated by the GP.
std::vector<RobotState> states_of(const Problem& problem, const Trajectory& at,
                                  Placement placement) {
  const GpPrior prior(problem.qc, problem.dt_s);
  const auto as_vector = [](std::span<const double> values) {
    return Eigen::VectorXd::Map(values.data(), static_cast<Eigen::Index>(values.size())).eval();
  };
  const auto support = [&](int i) { return RobotState{as_vector(at.q(i)), as_vector(at.qdot(i))}; };
  const int last = at.size() - 1;
  if (placement == Placement::kStart) return {support(0)};
  if (placement == Placement::kGoal) return {support(last)};
  std::vector<RobotState> states;
  for (int i = 0; i <= last; ++i) {
    states.push_back(support(i));
    if (placement == Placement::kSupport || i == last) continue;
    const RobotState a = support(i), b = support(i + 1);
    for (int k = 1; k <= problem.interpolated_checks; ++k) {
      const auto by = prior.interpolation(k / (problem.interpolated_checks + 1.0));
      states.push_back({by.lambda(0, 0) * a.q + by.lambda(0, 1) * a.qdot + by.psi(0, 0) * b.q +
                            by.psi(0, 1) * b.qdot,
                        by.lambda(1, 0) * a.q + by.lambda(1, 1) * a.qdot + by.psi(1, 0) * b.q +
                            by.psi(1, 1) * b.qdot});
    }
  }
  return states;
}

double prior_cost_of(const Problem& problem, const Trajectory& at) {
  const GpPrior prior(problem.qc, problem.dt_s);
  double sum = 0.0;
  for (int i = 0; i + 1 < at.size(); ++i) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(at.dof); ++j) {
      const Eigen::Vector2d e(at.q(i)[j] + problem.dt_s * at.qdot(i)[j] - at.q(i + 1)[j],
                              at.qdot(i)[j] - at.qdot(i + 1)[j]);
      sum += 0.5 * (prior.whitening() * e).squaredNorm() / problem.qc[static_cast<int>(j)];
    }
  }
  return sum;
}

/// By evaluate(), state by state.
double term_cost_of(const Problem& problem, const CostTerm& term, const Trajectory& at) {
  Scratch scratch;
  const double time_s = 0.0;
  double sum = 0.0;
  for (const RobotState& state : states_of(problem, at, term.placement)) {
    const auto d = static_cast<std::size_t>(state.q.size());
    std::vector<double> residuals(static_cast<std::size_t>(term.cost->residual_count()));
    term.cost->evaluate(
        {1, static_cast<int>(d), {state.q.data(), d}, {state.qdot.data(), d}, {&time_s, 1}},
        {residuals, {}, {}}, scratch);
    for (const double r : residuals) sum += 0.5 * r * r;
  }
  return sum;
}

struct NamedProblem {
  std::string name;
  Problem problem;
};

std::vector<NamedProblem> problems() {
  return {{"every cost", hsr_of_every_cost()},
          {"table", testing_support::hsr_reaches_table(20, 4)},
          {"ten joints", long_arm_bends(10)}};
}

TEST(ChainBatch, CostsWhatTheTermsSay) {
  for (const auto& [name, problem] : problems()) {
    for (const double by : {0.0, 0.05, 0.4}) {
      const Trajectory at = shaken(problem, 3, by);
      HostBatch batch(problem, {at});
      EXPECT_EQ(batch->move(0).value(), 1);
      const ChainState state = batch->outcome().value().states.front();
      const std::vector<double> terms = batch->term_costs(0).value();
      ASSERT_EQ(terms.size(), problem.terms.size() + 1);
      double sum = prior_cost_of(problem, at);
      EXPECT_NEAR(terms[0], sum, 1e-9 * (1.0 + sum)) << name;
      for (std::size_t t = 0; t < problem.terms.size(); ++t) {
        const double expected = term_cost_of(problem, problem.terms[t], at);
        EXPECT_NEAR(terms[t + 1], expected, 1e-9 * (1.0 + expected))
            << name << ": " << problem.terms[t].cost->name() << ", shaken by " << by;
        sum += expected;
      }
      EXPECT_NEAR(state.initial_cost, sum, 1e-9 * (1.0 + sum)) << name;
    }
  }
}

TEST(ChainBatch, EveryTermOfTheTestIsFelt) {
  const Problem problem = hsr_of_every_cost();
  std::vector<double> most(problem.terms.size());
  for (unsigned seed = 0; seed < 4; ++seed) {
    const Trajectory at = shaken(problem, seed, 0.6);
    for (std::size_t t = 0; t < problem.terms.size(); ++t) {
      most[t] = std::max(most[t], term_cost_of(problem, problem.terms[t], at));
    }
  }
  for (std::size_t t = 0; t < problem.terms.size(); ++t) {
    EXPECT_GT(most[t], 0.0) << problem.terms[t].cost->name();
  }
}

TEST(ChainBatch, FindsWhatTheSolverOfTheCpuFinds) {
  for (const auto& [name, problem] : problems()) {
    std::vector<Trajectory> initial = {line_of(problem)};
    for (unsigned seed = 1; seed < 4; ++seed) initial.push_back(shaken(problem, seed, 0.05));
    HostBatch batch(problem, initial);
    const BatchOutcome outcome = batch.finish();
    const auto cpu = make_gp_chain({});
    const Problem in_doubles = testing_support::linearised_in_doubles(problem);
    for (std::size_t i = 0; i < initial.size(); ++i) {
      const auto expected = cpu->solve(in_doubles, initial[i], Deadline());
      ASSERT_TRUE(expected.has_value());
      const ChainState& state = outcome.states[i];
      EXPECT_EQ(state.standing, Standing::kConverged) << name;
      EXPECT_EQ(expected->status, SolveStatus::kConverged) << name;
      EXPECT_LT(state.cost, state.initial_cost) << name;
      EXPECT_NEAR(state.cost, expected->cost, 1e-4 * expected->cost) << name << ", start " << i;
      EXPECT_NEAR(state.initial_cost, expected->initial_cost, 1e-9 * expected->initial_cost);
    }
  }
}

TEST(ChainBatch, IsTheSameInWhateverOrderThreadsRun) {
  const Problem problem = hsr_of_every_cost();
  const std::vector<Trajectory> initial = {line_of(problem), shaken(problem, 5, 0.1)};
  HostBatch forward(problem, initial);
  const BatchOutcome expected = forward.finish();
  for (const cuda::Order order : {cuda::Order::kBackward, cuda::Order::kShuffled}) {
    HostBatch other(problem, initial, {}, order);
    const BatchOutcome found = other.finish();
    EXPECT_TRUE(std::ranges::equal(found.trajectories, expected.trajectories));
    for (std::size_t i = 0; i < initial.size(); ++i) {
      EXPECT_EQ(found.states[i].cost, expected.states[i].cost);
      EXPECT_EQ(found.states[i].tried, expected.states[i].tried);
    }
  }
}

TEST(ChainBatch, IsTheSameHoweverItIsDividedIntoLaunches) {
  const Problem problem = testing_support::hsr_reaches_table(12, 2);
  const std::vector<Trajectory> initial = {shaken(problem, 5, 0.1)};
  HostBatch one(problem, initial), many(problem, initial);
  const BatchOutcome by_one = one.finish(1);
  const BatchOutcome at_once = many.finish(1000);
  EXPECT_GT(by_one.states.front().accepted, 2);
  EXPECT_EQ(by_one.states.front().tried, at_once.states.front().tried);
  EXPECT_TRUE(std::ranges::equal(by_one.trajectories, at_once.trajectories));
}

TEST(ChainBatch, SolvesOtherStartsAndGoalsSideBySide) {
  std::vector<Problem> all;
  for (int i = 0; i < 3; ++i) {
    Problem& problem = all.emplace_back(testing_support::hsr_reaches_table(12, 2));
    problem.start.q[1] += 0.2 * i;
    problem.goal.q[0] -= 0.1 * i;
    problem.terms = standard_terms(problem, {.epsilon_m = 0.2});
  }
  std::vector<std::vector<double>> supports, numbers;
  std::vector<ChainStart> starts;
  for (const Problem& problem : all) {
    supports.push_back(support_states_of(line_of(problem)));
    numbers.push_back(describe(problem)->own_numbers);
  }
  for (std::size_t i = 0; i < all.size(); ++i) starts.push_back({supports[i], numbers[i], 0});
  const auto described = describe(all.front()).value();
  const auto batch = make_host_batch(cuda::HostBackend()).value();
  ASSERT_TRUE(batch->set_field(described.field_shape, blocks_of(*described.field)).has_value());
  ASSERT_TRUE(
      batch->begin(described.chain, {}, starts, describe_samples(all.front(), 1.0)).has_value());
  while (batch->move(5).value() > 0) {
  }
  const auto outcome = batch->outcome().value();
  for (std::size_t i = 0; i < all.size(); ++i) {
    HostBatch alone(all[i], {line_of(all[i])});
    const BatchOutcome expected = alone.finish(5);
    const std::size_t size = expected.trajectories.size();
    EXPECT_TRUE(
        std::ranges::equal(outcome.trajectories.subspan(i * size, size), expected.trajectories))
        << "chain " << i;
  }
}

TEST(ChainBatch, KeepsEndsThatNoTermHolds) {
  Problem problem = testing_support::hsr_reaches_table(12, 2);
  std::erase_if(problem.terms, [](const CostTerm& term) {
    return term.placement == Placement::kStart || term.placement == Placement::kGoal;
  });
  HostBatch batch(problem, {line_of(problem)});
  const BatchOutcome outcome = batch.finish();
  const auto expected = make_gp_chain({})->solve(problem, line_of(problem), Deadline());
  EXPECT_NEAR(outcome.states.front().cost, expected->cost, 1e-4 * expected->cost);
  const auto first = outcome.trajectories.first(8), last = outcome.trajectories.last(16).first(8);
  EXPECT_TRUE(std::ranges::equal(first, problem.start.q));
  EXPECT_TRUE(std::ranges::equal(last, problem.goal.q));
}

TEST(ChainBatch, StraysAsThePriorDoes) {
  const Problem problem = testing_support::hsr_reaches_table(15, 2);
  const std::vector<double> line = support_states_of(line_of(problem));
  PriorSampler sampler;
  sampler.reset(problem);
  constexpr std::uint64_t kSeed = 9;
  constexpr double kSpread = 0.7;
  std::vector<double> expected(line.size());
  SamplesOnHost samples = describe_samples(problem, kSpread);
  std::vector<double> normals;
  for (std::uint64_t i = 1; i <= 2; ++i) {
    std::mt19937_64 generator(kSeed + i);
    std::normal_distribution<double> normal;
    for (std::size_t v = 0; v < line.size() + 5; ++v) normals.push_back(normal(generator));
  }
  samples.normals = normals;
  samples.stride = static_cast<std::int64_t>(line.size() + 5);
  samples.version = 1;
  const auto described = describe(problem).value();
  const auto batch = make_host_batch(cuda::HostBackend()).value();
  ASSERT_TRUE(batch->set_field(described.field_shape, blocks_of(*described.field)).has_value());
  const std::vector<ChainStart> starts = {{line, described.own_numbers, 0},
                                          {line, described.own_numbers, 2}};
  ASSERT_TRUE(batch->begin(described.chain, {}, starts, samples).has_value());
  ASSERT_TRUE(batch->move(0).has_value());
  const auto found = batch->outcome().value().trajectories;
  EXPECT_TRUE(std::ranges::equal(found.first(line.size()), line));
  sampler.draw(kSeed + 2, expected);
  double most = 0.0;
  for (std::size_t v = 0; v < line.size(); ++v) {
    EXPECT_NEAR(found[line.size() + v], line[v] + kSpread * expected[v], 1e-9) << v;
    most = std::max(most, std::abs(expected[v]));
  }
  EXPECT_GT(most, 0.1);
}

TEST(ChainBatch, SaysWhereTheMemoryIsTooSmall) {
  const Problem problem = testing_support::hsr_reaches_table(12, 2);
  const auto described = describe(problem).value();
  const auto small = make_host_batch(cuda::HostBackend(cuda::Order::kForward, 1000)).value();
  const auto no_field = small->set_field(described.field_shape, blocks_of(*described.field));
  ASSERT_FALSE(no_field.has_value());
  EXPECT_EQ(no_field.error().code, ErrorCode::kUnsupported);
  const std::vector<double> line = support_states_of(line_of(problem));
  const std::vector<ChainStart> starts(10, {line, described.own_numbers, 0});
  const auto begun = small->begin(described.chain, {}, starts, describe_samples(problem, 1.0));
  ASSERT_FALSE(begun.has_value());
  EXPECT_EQ(begun.error().code, ErrorCode::kUnsupported);
}

TEST(ChainBatch, EndsAtItsLimitAndAtWhatIsNoNumber) {
  const Problem problem = testing_support::hsr_reaches_table(12, 2);
  HostBatch limited(problem, {shaken(problem, 1, 0.2)}, {.stop = {.max_iterations = 1}});
  const BatchOutcome at_limit = limited.finish();
  EXPECT_EQ(at_limit.states.front().standing, Standing::kIterationLimit);
  EXPECT_EQ(at_limit.states.front().accepted, 1);
  Trajectory broken = line_of(problem);
  broken.q(4)[2] = std::numeric_limits<double>::quiet_NaN();
  HostBatch batch(problem, {broken, line_of(problem)});
  const BatchOutcome outcome = batch.finish();
  EXPECT_EQ(outcome.states[0].standing, Standing::kNotFinite);
  EXPECT_EQ(outcome.states[1].standing, Standing::kConverged);
}

TEST(ChainBatch, EndsWhereTheNormalEquationsAreSingular) {
  Problem problem = testing_support::hsr_reaches_table(12, 2);
  problem.qc *= 1e-310;  // its inverse is infinite
  HostBatch batch(problem, {line_of(problem)});
  const BatchOutcome outcome = batch.finish();
  EXPECT_NE(outcome.states.front().standing, Standing::kConverged);
}

TEST(ChainBatch, SolvesTheSceneThatDevicesAreCheckedWith) {
  ChainScene scene(6, 14, 3, {96, 80, 32});
  for (int i = 0; i < 6; ++i) scene.add_start(i);
  const auto batch = make_host_batch(cuda::HostBackend()).value();
  ASSERT_TRUE(batch->set_field(scene.shape(), scene.blocks()).has_value());
  ASSERT_TRUE(batch->begin(scene.description(), {}, scene.starts(), scene.samples()).has_value());
  while (batch->move(5).value() > 0) {
  }
  const auto outcome = batch->outcome().value();
  double most = 0.0;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(outcome.states[i].standing, Standing::kConverged);
    EXPECT_LT(outcome.states[i].cost, outcome.states[i].initial_cost);
    most = std::max(most, batch->term_costs(static_cast<int>(i)).value()[3]);
  }
  EXPECT_GT(most, 0.0) << "no chain met an obstacle";
}

}  // namespace
}  // namespace sidestep::gp_chain_cuda::test
