#pragma once

#include <functional>
#include <memory>

#include <sidestep/core/export.hpp>

namespace sidestep {

/// The threads that the host lends to plugins for data-parallel work; a plugin starts none
/// of its own. Waits passively: a busy neighbour on the machine costs its share, no more.
class SIDESTEP_EXPORT WorkerPool {
 public:
  /// `threads` >= 1, counting the calling thread.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  [[nodiscard]] int thread_count() const noexcept { return thread_count_; }

  /// Calls task(i) once for each i in [0, count), on the calling thread and the pool's, and
  /// returns when all are done; on the calling thread alone, in order, where the pool has one
  /// thread. An exception in a task is rethrown here. [any]: callers share the threads. Not for
  /// use inside a task.
  void run(int count, const std::function<void(int)>& task);

  /// Splits [0, count) into contiguous bands of at least `grain`, and calls band(begin, end).
  void run_banded(int count, int grain, const std::function<void(int, int)>& band);

 private:
  struct Impl;
  int thread_count_ = 1;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sidestep
