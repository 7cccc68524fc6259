#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <span>
#include <vector>

/// What the bodies of kernels are written with: the same source for g++, which runs them on the
/// host, and for nvcc. Nothing here needs CUDA's headers.
#if defined(__CUDACC__)
#define SIDESTEP_HOST_DEVICE __host__ __device__
#else
#define SIDESTEP_HOST_DEVICE
#endif

/// How kernels are written. A kernel is a plain struct that holds pointers and sizes, is copied to
/// the device as its argument, and has
///
///     static constexpr int kThreads = 256;   // of a block, a multiple of kWarp
///     static constexpr int kPhases = 2;      // parts between which the threads of a block meet
///     struct Shared { ... };                 // memory of a block, trivially copyable, rubbish at
///     first template <int kPhase> SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread,
///     Shared& shared) const;
///
/// Phase n + 1 of a block begins once phase n of all its threads has ended. Blocks may run in any
/// order, as may the threads of a phase, warps as a whole. A kernel whose phases depend on what it
/// computes has no kPhases, and is written with a Team.
namespace sidestep::cuda {

/// Threads that go in step: a row of columns is one of these.
inline constexpr int kWarp = 32;

/// Values, for the functions that return them are the host's alone.
inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
inline constexpr float kInfinityF = std::numeric_limits<float>::infinity();
inline constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
inline constexpr double kLargest = std::numeric_limits<double>::max();
inline constexpr float kLargestF = std::numeric_limits<float>::max();

/// Three integers along x, y and z; a plain type, for kernels know no Eigen.
struct Extent {
  int x = 0;
  int y = 0;
  int z = 0;
};

template <class T>
SIDESTEP_HOST_DEVICE constexpr T least_of(T a, T b) {
  return b < a ? b : a;
}
template <class T>
SIDESTEP_HOST_DEVICE constexpr T most_of(T a, T b) {
  return a < b ? b : a;
}

/// The lowest and the highest bit that is set; `bits` is not 0.
SIDESTEP_HOST_DEVICE inline int lowest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return __ffs(static_cast<int>(bits)) - 1;
#else
  return std::countr_zero(bits);
#endif
}
SIDESTEP_HOST_DEVICE inline int highest_bit(std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return 31 - __clz(static_cast<int>(bits));
#else
  return 31 - std::countl_zero(bits);
#endif
}

/// What threads do to a value that others change as well. On the host, where threads run one after
/// the other, plain steps. Each returns the value before.
SIDESTEP_HOST_DEVICE inline std::uint32_t set_bits(std::uint32_t& word, std::uint32_t bits) {
#if defined(__CUDA_ARCH__)
  return atomicOr(&word, bits);
#else
  const std::uint32_t before = word;
  word |= bits;
  return before;
#endif
}
SIDESTEP_HOST_DEVICE inline std::uint32_t add_to(std::uint32_t& sum, std::uint32_t value) {
#if defined(__CUDA_ARCH__)
  return atomicAdd(&sum, value);
#else
  const std::uint32_t before = sum;
  sum += value;
  return before;
#endif
}
SIDESTEP_HOST_DEVICE inline int lower_to(int& least, int value) {
#if defined(__CUDA_ARCH__)
  return atomicMin(&least, value);
#else
  const int before = least;
  least = least_of(least, value);
  return before;
#endif
}
SIDESTEP_HOST_DEVICE inline int raise_to(int& most, int value) {
#if defined(__CUDA_ARCH__)
  return atomicMax(&most, value);
#else
  const int before = most;
  most = most_of(most, value);
  return before;
#endif
}

/// lower_to() and raise_to() with the least and greatest value of a warp, every thread of which
/// calls it at once: one step in memory instead of 32.
SIDESTEP_HOST_DEVICE inline void lower_to_warps(int& least, int value) {
#if defined(__CUDA_ARCH__)
  for (int step = kWarp / 2; step > 0; step /= 2) {
    value = least_of(value, __shfl_xor_sync(0xffffffffu, value, step));
  }
  if (threadIdx.x % kWarp != 0) return;
#endif
  lower_to(least, value);
}
SIDESTEP_HOST_DEVICE inline void raise_to_warps(int& most, int value) {
#if defined(__CUDA_ARCH__)
  for (int step = kWarp / 2; step > 0; step /= 2) {
    value = most_of(value, __shfl_xor_sync(0xffffffffu, value, step));
  }
  if (threadIdx.x % kWarp != 0) return;
#endif
  raise_to(most, value);
}

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

/// Whether a kernel is written with a Team.
template <class Kernel>
concept TeamKernel = !requires {
  Kernel::kPhases;
};

/// In which order run_on_host() goes through blocks and threads: whatever depends on it is a race.
enum class Order { kForward, kBackward, kShuffled };

namespace detail {

template <class Kernel, int kPhase>
void run_phases(const Kernel& kernel, std::int64_t block, const std::vector<int>& threads,
                typename Kernel::Shared& shared) {
  for (const int thread : threads) kernel.template run<kPhase>(block, thread, shared);
  if constexpr (kPhase + 1 < Kernel::kPhases) {
    run_phases<Kernel, kPhase + 1>(kernel, block, threads, shared);
  }
}

}  // namespace detail

/// Runs a kernel's `blocks` blocks on the calling thread.
template <class Kernel>
void run_on_host(const Kernel& kernel, std::int64_t blocks, Order order = Order::kForward) {
  std::vector<int> threads(Kernel::kThreads);
  std::iota(threads.begin(), threads.end(), 0);
  std::mt19937 random(7);
  if (order == Order::kBackward) std::ranges::reverse(threads);
  typename Kernel::Shared shared;
  for (std::int64_t i = 0; i < blocks; ++i) {
    std::memset(&shared, 0xa5, sizeof(shared));  // whoever reads what nobody wrote shall notice
    if (order == Order::kShuffled) std::ranges::shuffle(threads, random);
    const std::int64_t block = order == Order::kForward ? i : blocks - 1 - i;
    if constexpr (TeamKernel<Kernel>) {
      Team team(threads);
      kernel.run(block, team, shared);
    } else {
      detail::run_phases<Kernel, 0>(kernel, block, threads, shared);
    }
  }
}

}  // namespace sidestep::cuda
