#include <sidestep/core/worker_pool.hpp>

#include <algorithm>

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

namespace sidestep {

struct WorkerPool::Impl {
  explicit Impl(int threads)
      // TBB's own limit is the number of cores, and it warns when more are asked for.
      : limit(tbb::global_control::max_allowed_parallelism,
              std::max(
                  static_cast<std::size_t>(threads),
                  tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism))),
        arena(threads) {}
  tbb::global_control limit;
  tbb::task_arena arena;
};

WorkerPool::WorkerPool(int threads)
    : thread_count_(std::max(1, threads)), impl_(std::make_unique<Impl>(thread_count_)) {}

WorkerPool::~WorkerPool() = default;

void WorkerPool::run(int count, const std::function<void(int)>& task) {
  if (thread_count_ == 1 || count <= 1) {
    for (int i = 0; i < count; ++i) task(i);
    return;
  }
  impl_->arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, count, 1),
        [&](const tbb::blocked_range<int>& range) {
          for (int i = range.begin(); i < range.end(); ++i) task(i);
        },
        tbb::simple_partitioner());
  });
}

void WorkerPool::run_banded(int count, int grain, const std::function<void(int, int)>& band) {
  if (count <= 0) return;
  // Four bands a thread: enough to even out bands of unequal work, few enough to cost nothing.
  const int bands = std::clamp(count / std::max(1, grain), 1, 4 * thread_count_);
  run(bands, [&](int i) {
    const auto edge = [&](int b) {
      return static_cast<int>(static_cast<long long>(count) * b / bands);
    };
    band(edge(i), edge(i + 1));
  });
}

}  // namespace sidestep
