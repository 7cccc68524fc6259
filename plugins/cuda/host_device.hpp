#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>

/// What the bodies of kernels are written with: the same source for g++, which runs them on the
/// host, and for nvcc. Nothing here needs CUDA's headers.
#if defined(__CUDACC__)
#define SIDESTEP_HOST_DEVICE __host__ __device__
#else
#define SIDESTEP_HOST_DEVICE
#endif

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

}  // namespace sidestep::cuda
