#include <cmath>
#include <filesystem>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/experiments/recorded_problems.hpp>

#include "conformance/optimiser_conformance.hpp"
#include "gp_chain.hpp"
#include "prior_sampler.hpp"

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
      const Trajectory initial = recorded_initial(problem);
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
