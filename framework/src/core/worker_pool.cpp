#include <sidestep/core/worker_pool.hpp>

#include <algorithm>
#include <optional>
#include <string_view>

#include <sidestep/core/plugin_calls.hpp>

#if defined(__SANITIZE_THREAD__)
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>
#else
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>
#endif

namespace sidestep {

#if defined(__SANITIZE_THREAD__)

/// ThreadSanitizer cannot see how TBB synchronises, and would call all of it races: it is given
/// plain threads, so that what runs on them is judged.
struct WorkerPool::Impl {
  explicit Impl(int threads) : helpers(threads - 1) {}

  void run(int count, const std::function<void(int)>& task) const {
    std::atomic<int> next = 0;
    std::mutex mutex;
    std::exception_ptr failure;
    const auto work = [&] {
      for (int i = next++; i < count; i = next++) {
        try {
          task(i);
        } catch (...) {
          const std::scoped_lock lock(mutex);
          if (!failure) failure = std::current_exception();
        }
      }
    };
    {
      std::vector<std::jthread> threads;
      for (int i = 0; i < helpers; ++i) threads.emplace_back(work);
      work();
    }
    if (failure) std::rethrow_exception(failure);
  }

  int helpers;
};

#else

struct WorkerPool::Impl {
  explicit Impl(int threads)
      // TBB's own limit is the number of cores, and it warns when more are asked for.
      : limit(tbb::global_control::max_allowed_parallelism,
              std::max(
                  static_cast<std::size_t>(threads),
                  tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism))),
        arena(threads) {}

  void run(int count, const std::function<void(int)>& task) {
    arena.execute([&] {
      tbb::parallel_for(
          tbb::blocked_range<int>(0, count, 1),
          [&](const tbb::blocked_range<int>& range) {
            for (int i = range.begin(); i < range.end(); ++i) task(i);
          },
          tbb::simple_partitioner());
    });
  }

  tbb::global_control limit;
  tbb::task_arena arena;
};

#endif

WorkerPool::WorkerPool(int threads)
    : thread_count_(std::max(1, threads)), impl_(std::make_unique<Impl>(thread_count_)) {}

WorkerPool::~WorkerPool() = default;

void WorkerPool::run(int count, const std::function<void(int)>& task) {
  if (thread_count_ == 1 || count <= 1) {
    for (int i = 0; i < count; ++i) task(i);
    return;
  }
  const std::string_view plugin = PluginCall::current();
  if (plugin.empty()) return impl_->run(count, task);
  impl_->run(count, [&](int i) {
    std::optional<PluginCall> lent;
    if (PluginCall::current().empty()) lent.emplace(plugin);
    task(i);
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
