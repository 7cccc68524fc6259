#include "cuda/kernel.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

#include "cuda/host_backend.hpp"

namespace sidestep::cuda {
namespace {

/// Sums numbers block by block: each thread writes one to the block's memory, the first adds them.
struct SumOfBlocks {
  static constexpr int kThreads = 64;
  static constexpr int kPhases = 2;
  struct Shared {
    int values[kThreads];
  };
  const int* numbers = nullptr;
  int* sums = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared& shared) const {
    if constexpr (kPhase == 0) {
      shared.values[thread] = numbers[block * kThreads + thread];
    } else if (thread == 0) {
      sums[block] = 0;
      for (const int value : shared.values) sums[block] += value;
    }
  }
};

class HostOrder : public testing::TestWithParam<Order> {};

TEST_P(HostOrder, PhasesEndBeforeTheNextBegins) {
  constexpr int kBlocks = 5;
  std::vector<int> numbers(kBlocks * SumOfBlocks::kThreads);
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<int>(i * i);
  std::vector<int> sums(kBlocks, -1);
  run_on_host(SumOfBlocks{numbers.data(), sums.data()}, kBlocks, GetParam());
  for (int block = 0; block < kBlocks; ++block) {
    int expected = 0;
    for (int i = 64 * block; i < 64 * (block + 1); ++i) expected += i * i;
    EXPECT_EQ(sums[static_cast<std::size_t>(block)], expected);
  }
}

/// Halves numbers until their sum is below one, and counts how often: phases that depend on what is
/// computed.
struct HalveToOne {
  static constexpr int kThreads = 64;
  struct Shared {
    double sums[kThreads];
    double values[kThreads];
  };
  const double* numbers = nullptr;
  int* halvings = nullptr;

  SIDESTEP_HOST_DEVICE void run(std::int64_t block, Team& team, Shared& shared) const {
    team.each([&](int thread) { shared.values[thread] = numbers[block * kThreads + thread]; });
    int count = 0;
    while (team.sum(shared.sums, [&](int thread) { return shared.values[thread]; }) >= 1.0) {
      // Each thread takes its neighbour's: right only if all have read before one writes.
      team.each([&](int thread) { shared.sums[thread] = 0.5 * shared.values[thread ^ 1]; });
      team.each([&](int thread) { shared.values[thread] = shared.sums[thread]; });
      ++count;
    }
    team.each([&](int thread) {
      if (thread == 0) halvings[block] = count;
    });
  }
};

TEST_P(HostOrder, TeamsGoOnAsLongAsTheyCompute) {
  constexpr int kBlocks = 4;
  std::vector<double> numbers(kBlocks * HalveToOne::kThreads);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = i / HalveToOne::kThreads == 3 ? 0.0 : static_cast<double>(i);
  }
  std::vector<int> halvings(kBlocks, -1);
  run_on_host(HalveToOne{numbers.data(), halvings.data()}, kBlocks, GetParam());
  // 0 + ... + 63 = 2016 < 2^11, 64 + ... + 127 = 6112 < 2^13, 128 + ... + 191 = 10208 < 2^14.
  EXPECT_EQ(halvings, (std::vector<int>{11, 13, 14, 0}));
}

INSTANTIATE_TEST_SUITE_P(Orders, HostOrder,
                         testing::Values(Order::kForward, Order::kBackward, Order::kShuffled));

/// A thread's number plus what the thread before it has left: right in one order only.
struct Race {
  static constexpr int kThreads = 64;
  static constexpr int kPhases = 1;
  struct Shared {};
  int* values = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t, int thread, Shared&) const {
    values[thread] = thread + (thread > 0 ? values[thread - 1] : 0);
  }
};

TEST(HostOrders, ShowARace) {
  const auto last = [](Order order) {
    std::vector<int> values(Race::kThreads, 0);
    run_on_host(Race{values.data()}, 1, order);
    return values.back();
  };
  EXPECT_NE(last(Order::kForward), last(Order::kBackward));
  EXPECT_NE(last(Order::kForward), last(Order::kShuffled));
}

TEST(HostBackend, RefusesMoreMemoryThanItHas) {
  HostBackend backend(Order::kForward, 1000);
  EXPECT_TRUE(backend.allocate<int>(200));
  const auto refused = backend.allocate<int>(100);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsupported);
}

TEST(HostBackend, TimesTheStagesOfAnUpdate) {
  HostBackend backend;
  auto numbers = backend.allocate<int>(1 << 20);
  ASSERT_TRUE(numbers);
  for (int update = 0; update < 2; ++update) {
    const auto begin = std::chrono::steady_clock::now();
    backend.enter();
    backend.stage(Stage::kUpload);
    backend.clear(*numbers);
    backend.stage(Stage::kTransform);
    backend.clear(*numbers);
    ASSERT_TRUE(backend.finish());
    backend.stage(Stage::kUpload);  // a second part of it
    backend.clear(*numbers);
    ASSERT_TRUE(backend.finish());
    const std::chrono::duration<double, std::milli> passed =
        std::chrono::steady_clock::now() - begin;
    const StageTimes& times = backend.times();
    EXPECT_GT(times.of(Stage::kUpload), 0.0);
    EXPECT_GT(times.of(Stage::kTransform), 0.0);
    EXPECT_EQ(times.of(Stage::kIntegrate), 0.0);
    EXPECT_LE(times.of(Stage::kUpload) + times.of(Stage::kTransform), passed.count());
  }
}

TEST(Bits, LowestAndHighest) {
  for (int bit = 0; bit < 32; ++bit) {
    EXPECT_EQ(lowest_bit(1u << bit), bit);
    EXPECT_EQ(highest_bit(1u << bit), bit);
    EXPECT_EQ(lowest_bit(~0u << bit), bit);
    EXPECT_EQ(highest_bit(~0u >> bit), 31 - bit);
  }
}

TEST(Atomics, ReturnWhatWasThere) {
  std::uint32_t word = 5;
  EXPECT_EQ(set_bits(word, 10u), 5u);
  EXPECT_EQ(add_to(word, 2u), 15u);
  EXPECT_EQ(word, 17u);
  int value = 3;
  EXPECT_EQ(lower_to(value, 4), 3);
  EXPECT_EQ(raise_to(value, 7), 3);
  EXPECT_EQ(lower_to(value, -1), 7);
  EXPECT_EQ(value, -1);
}

}  // namespace
}  // namespace sidestep::cuda
