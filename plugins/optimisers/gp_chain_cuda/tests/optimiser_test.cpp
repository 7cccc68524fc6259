#include <cmath>

#include "conformance/optimiser_conformance.hpp"
#include "conformance/test_host.hpp"

#include "batch_problems.hpp"
#include "gp_chain_cuda.hpp"

namespace sidestep::gp_chain_cuda::test {
namespace {

using conformance::OptimiserCase;
using conformance::OptimiserConformance;
using conformance::RecordingLog;

MakeBatch host_batches() {
  return [] { return make_host_batch(cuda::HostBackend()); };
}

/// As where there is no device.
Result<std::unique_ptr<ChainBatch>> no_batch() {
  return fail(ErrorCode::kPlugin, "there is no device", "CUDA device 0");
}

Options options_of(int starts, const std::string& fallback = "none") {
  Options options;
  options.starts = starts;
  options.fallback = fallback;
  return options;
}

std::unique_ptr<Optimiser> on_host(const Options& options, Log& log) {
  return make_gp_chain_cuda(options, nullptr, log, 1, host_batches()).value();
}

/// A cost that does not say what it is made of.
class SecretCost final : public StateCost {
 public:
  [[nodiscard]] std::string_view name() const noexcept override { return "secret"; }
  [[nodiscard]] int residual_count() const noexcept override { return 1; }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  void evaluate(const StateBatch&, const CostBatch& out, Scratch&) const override {
    std::ranges::fill(out.residuals, 0.0);
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
  }
};

/// A batch whose device is lost at the first launch.
class LostBatch final : public ChainBatch {
 public:
  Result<void> set_field(const FieldOnDevice&, std::span<const FieldBlockOnHost>) override {
    return {};
  }
  Result<void> begin(const ChainDescription&, const MinimisationRules&, std::span<const ChainStart>,
                     const SamplesOnHost&) override {
    return {};
  }
  Result<int> move(int) override {
    return fail(ErrorCode::kPlugin, "a kernel failed, or the device was lost", "CUDA device 0");
  }
  Result<BatchOutcome> outcome() override { return BatchOutcome{}; }
  Result<std::vector<double>> term_costs(int) override { return std::vector<double>{}; }
  const cuda::StageTimes& times() const noexcept override { return times_; }

 private:
  cuda::StageTimes times_;
};

// The suite's robot and field are none of those that kernels know, so that these are solved by the
// fallback: what is refused, and when it is, is the same.
INSTANTIATE_TEST_SUITE_P(GpChainCuda, OptimiserConformance,
                         testing::Values(OptimiserCase{"with_fallback",
                                                       [] {
                                                         static RecordingLog log;
                                                         return on_host(options_of(1, "cpu"), log);
                                                       }}),
                         [](const auto& of) { return of.param.name; });

TEST(GpChainCuda, SolvesAsGpChain) {
  RecordingLog log;
  const Problem problem = testing_support::hsr_reaches_table(20, 4);
  const auto found = on_host(options_of(1), log)->solve(problem, line_of(problem), Deadline());
  const auto expected = make_gp_chain({})->solve(problem, line_of(problem), Deadline());
  ASSERT_TRUE(found.has_value()) << found.error().describe();
  EXPECT_EQ(found->status, expected->status);
  EXPECT_NEAR(found->cost, expected->cost, 1e-4 * expected->cost);
  ASSERT_EQ(found->terms.size(), expected->terms.size());
  for (std::size_t t = 0; t < found->terms.size(); ++t) {
    EXPECT_EQ(found->terms[t].name, expected->terms[t].name);
    EXPECT_NEAR(found->terms[t].cost, expected->terms[t].cost, 1e-3 * expected->cost);
  }
  ASSERT_EQ(found->trajectory.positions.size(), expected->trajectory.positions.size());
  for (std::size_t i = 0; i < found->trajectory.positions.size(); ++i) {
    EXPECT_NEAR(found->trajectory.positions[i], expected->trajectory.positions[i], 1e-2);
  }
  EXPECT_TRUE(log.messages().empty());
}

TEST(GpChainCuda, ChoosesAmongStartsAsGpChain) {
  RecordingLog log;
  const Problem problem = testing_support::hsr_reaches_table(16, 2);
  for (const char* accept : {"best_valid", "first_valid"}) {
    Options options = options_of(6);
    options.accept = accept;
    options.spread = 0.3;
    const auto found = on_host(options, log)->solve(problem, line_of(problem), Deadline());
    const GpChainSettings same = options;
    const auto expected = make_gp_chain(same)->solve(problem, line_of(problem), Deadline());
    ASSERT_TRUE(found.has_value() && expected.has_value());
    EXPECT_NEAR(found->cost, expected->cost, 1e-4 * expected->cost) << accept;
    EXPECT_EQ(
        found->initial_cost,
        on_host(options_of(1), log)->solve(problem, line_of(problem), Deadline())->initial_cost);
  }
}

TEST(GpChainCuda, SolvesOneProblemAfterAnother) {
  RecordingLog log;
  const auto optimiser = on_host(options_of(3), log);
  for (const Problem& problem : {testing_support::hsr_reaches_table(10, 2), hsr_of_every_cost(),
                                 long_arm_bends(10), testing_support::hsr_reaches_table(20, 4)}) {
    const auto found = optimiser->solve(problem, line_of(problem), Deadline());
    const auto again = on_host(options_of(3), log)->solve(problem, line_of(problem), Deadline());
    ASSERT_TRUE(found.has_value()) << found.error().describe();
    EXPECT_EQ(found->trajectory.positions, again->trajectory.positions);
    EXPECT_EQ(found->cost, again->cost);
  }
}

TEST(GpChainCuda, ReturnsWhatItHasAtTheDeadline) {
  RecordingLog log;
  const Problem problem = testing_support::hsr_reaches_table(16, 2);
  const auto found =
      on_host(options_of(2), log)->solve(problem, line_of(problem), Deadline::after_s(0.0));
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->status, SolveStatus::kDeadline);
  EXPECT_EQ(found->trajectory.positions, line_of(problem).positions);
  EXPECT_EQ(found->iterations, 0);
}

TEST(GpChainCuda, NamesTheTermThatIsNoNumber) {
  RecordingLog log;
  Problem problem = testing_support::hsr_reaches_table(16, 2);
  const GridSpec grid = problem.field->info().grid;
  problem.field = testing_support::sampled_field(
      grid, [](const Eigen::Vector3d&) { return std::numeric_limits<double>::quiet_NaN(); });
  problem.terms = standard_terms(problem, {.epsilon_m = 0.2});
  const auto found = on_host(options_of(2), log)->solve(problem, line_of(problem), Deadline());
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->status, SolveStatus::kFailed);
  EXPECT_NE(found->reason.find("obstacle"), std::string::npos) << found->reason;
  EXPECT_EQ(found->trajectory.size(), 0);
}

TEST(GpChainCuda, RefusesACostThatItDoesNotKnowAndNamesIt) {
  RecordingLog log;
  Problem problem = testing_support::hsr_reaches_table(10, 2);
  problem.terms.push_back({std::make_shared<SecretCost>(), Placement::kSupport});
  const auto refused = on_host(options_of(1), log)->solve(problem, line_of(problem), Deadline());
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find("secret"), std::string::npos);
  EXPECT_NE(refused.error().hint.find("fallback"), std::string::npos);

  const auto optimiser = on_host(options_of(1, "cpu"), log);
  EXPECT_TRUE(optimiser->solve(problem, line_of(problem), Deadline()).has_value());
  EXPECT_TRUE(optimiser->solve(problem, line_of(problem), Deadline()).has_value());
  EXPECT_EQ(log.count(LogLevel::kWarning), 1);
}

TEST(GpChainCuda, GoesOnWithoutADeviceWhereThatIsWanted) {
  RecordingLog log;
  EXPECT_FALSE(make_gp_chain_cuda(options_of(4), nullptr, log, 1, no_batch).has_value());
  const auto made = make_gp_chain_cuda(options_of(4, "cpu"), nullptr, log, 1, no_batch);
  ASSERT_TRUE(made.has_value());
  const Problem problem = testing_support::hsr_reaches_table(10, 2);
  const auto found = (*made)->solve(problem, line_of(problem), Deadline());
  ASSERT_TRUE(found.has_value());
  EXPECT_NE(found->status, SolveStatus::kFailed);
  ASSERT_EQ(log.count(LogLevel::kWarning), 1);
  EXPECT_NE(log.messages().front().find("no device"), std::string::npos);
}

TEST(GpChainCuda, GoesOnWhenTheDeviceIsLost) {
  RecordingLog log;
  const auto lost = []() -> Result<std::unique_ptr<ChainBatch>> {
    return std::make_unique<LostBatch>();
  };
  const Problem problem = testing_support::hsr_reaches_table(10, 2);
  const auto fails = make_gp_chain_cuda(options_of(2), nullptr, log, 1, lost).value();
  const auto failed = fails->solve(problem, line_of(problem), Deadline());
  ASSERT_FALSE(failed.has_value());
  EXPECT_NE(failed.error().message.find("lost"), std::string::npos);
  const auto goes_on = make_gp_chain_cuda(options_of(2, "cpu"), nullptr, log, 1, lost).value();
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(goes_on->solve(problem, line_of(problem), Deadline()).has_value());
  }
  EXPECT_EQ(log.count(LogLevel::kWarning), 1);
}

TEST(FieldMirror, SendsOnlyBlocksThatAreNew) {
  const Problem problem = testing_support::hsr_reaches_table(10, 2);
  const auto described = describe(problem).value();
  const auto batch = make_host_batch(cuda::HostBackend()).value();
  FieldMirror mirror;
  const DenseField& first = *described.field;
  ASSERT_TRUE(mirror.show(*batch, described.field_shape, first).has_value());
  EXPECT_EQ(mirror.sent(), first.blocks().size());
  ASSERT_TRUE(mirror.show(*batch, described.field_shape, first).has_value());
  EXPECT_EQ(mirror.sent(), 0U);
  DenseField::Blocks blocks = first.blocks();
  auto other = std::make_shared<FieldBlock>(blocks.block(7));
  other->distance_m.fill(0.01F);
  blocks.set(7, other);
  const DenseField second(first.info(), blocks, first.known_blocks());
  ASSERT_TRUE(mirror.show(*batch, described.field_shape, second).has_value());
  EXPECT_EQ(mirror.sent(), 1U);
}

}  // namespace
}  // namespace sidestep::gp_chain_cuda::test
