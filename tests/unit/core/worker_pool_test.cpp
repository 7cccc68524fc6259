#include <atomic>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/worker_pool.hpp>

namespace sidestep {
namespace {

TEST(WorkerPool, RunsEveryTaskOnce) {
  for (const int threads : {1, 2, 4}) {
    WorkerPool pool(threads);
    std::vector<std::atomic<int>> calls(1000);
    pool.run(1000, [&](int i) { ++calls[static_cast<std::size_t>(i)]; });
    for (const auto& count : calls) ASSERT_EQ(count, 1);
  }
}

TEST(WorkerPool, BandsCoverTheRangeWithoutOverlap) {
  WorkerPool pool(3);
  for (const int count : {0, 1, 7, 64, 1000}) {
    std::vector<std::atomic<int>> calls(static_cast<std::size_t>(count));
    pool.run_banded(count, 16, [&](int begin, int end) {
      ASSERT_LT(begin, end);
      for (int i = begin; i < end; ++i) ++calls[static_cast<std::size_t>(i)];
    });
    for (const auto& calls_of_one : calls) ASSERT_EQ(calls_of_one, 1);
  }
}

TEST(WorkerPool, AnExceptionReachesTheCaller) {
  WorkerPool pool(2);
  EXPECT_THROW(pool.run(100,
                        [](int i) {
                          if (i == 50) throw std::runtime_error("task 50");
                        }),
               std::runtime_error);
  std::atomic<int> calls = 0;
  pool.run(10, [&](int) { ++calls; });
  EXPECT_EQ(calls, 10) << "the pool goes on after an exception";
}

}  // namespace
}  // namespace sidestep
