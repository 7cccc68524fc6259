#pragma once

#include <span>

#include "cuda/host_device.hpp"

namespace sidestep::cuda {

/// The threads of a block as those of a kernel see them whose phases depend on what it computes:
///
///     static constexpr int kThreads = 128;   // of a block, a multiple of kWarp
///     struct Shared { ... };                 // as in kernel.hpp
///     SIDESTEP_HOST_DEVICE void run(std::int64_t block, Team& team, Shared& shared) const;
///
/// What stands outside of each() every thread does by itself, in variables of its own. It reads
/// memory that threads share, and never writes it; what it reads the next each() does not write.
class Team {
 public:
  Team() = default;
  /// On the host: the order of threads within a phase.
  explicit Team(std::span<const int> threads)
      : threads_(threads.data()), count_(static_cast<int>(threads.size())) {}

  /// A phase: every thread calls work(thread), then all meet.
  template <class Work>
  SIDESTEP_HOST_DEVICE void each(const Work& work) {
#if defined(__CUDA_ARCH__)
    work(static_cast<int>(threadIdx.x));
    __syncthreads();
#else
    for (int i = 0; i < count_; ++i) work(threads_[i]);
#endif
  }

  /// The sum of value(thread), the same for every thread, added in the order of threads.
  template <int kThreads, class Value>
  SIDESTEP_HOST_DEVICE double sum(double (&room)[kThreads], const Value& value) {
    each([&](int thread) { room[thread] = value(thread); });
    double all = 0.0;
    for (int i = 0; i < kThreads; ++i) all += room[i];
    each([](int) {});  // all have read what the next sum writes
    return all;
  }

 private:
  const int* threads_ = nullptr;
  int count_ = 0;
};

}  // namespace sidestep::cuda
