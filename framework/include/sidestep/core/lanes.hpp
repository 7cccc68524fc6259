#pragma once

#include <cstddef>
#include <vector>

// Kernels are compiled for several instruction sets; the best is chosen when the library is loaded.
// Sanitizers run before the resolvers of multi-versioned functions could.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && defined(__OPTIMIZE__)
#define SIDESTEP_CLONES_FOR(...) [[gnu::target_clones(__VA_ARGS__)]]
#else
#define SIDESTEP_CLONES_FOR(...)
#endif
#define SIDESTEP_SIMD_CLONES SIDESTEP_CLONES_FOR("default", "arch=x86-64-v3", "arch=x86-64-v4")

/// For the parts of kernels: a clone does not inline what is compiled for another target.
#define SIDESTEP_INLINE [[gnu::always_inline]] inline

namespace sidestep {

/// std::min and std::max for kernels.
template <class T>
SIDESTEP_INLINE T lesser(T a, T b) noexcept {
  return b < a ? b : a;
}
template <class T>
SIDESTEP_INLINE T greater(T a, T b) noexcept {
  return a < b ? b : a;
}

/// Doubles that kernels compute with at once.
inline constexpr std::size_t kLanes = 8;

/// Floats, in as many bytes.
inline constexpr std::size_t kFloatLanes = 16;

/// kLanes points, coordinate by coordinate.
struct alignas(64) PointLanes {
  double x[kLanes], y[kLanes], z[kLanes];
};

/// kFloatLanes points, coordinate by coordinate, in single precision.
struct alignas(64) PointFloats {
  float x[kFloatLanes], y[kFloatLanes], z[kFloatLanes];
};

/// Groups of kFloatLanes that hold `count`.
[[nodiscard]] constexpr std::size_t float_groups(std::size_t count) noexcept {
  return (count + kFloatLanes - 1) / kFloatLanes;
}

/// `count` rounded up to whole lanes.
[[nodiscard]] constexpr std::size_t padded(std::size_t count) noexcept {
  return (count + kLanes - 1) / kLanes * kLanes;
}

/// Doubles that begin on a cache line. Keeps its memory when it shrinks.
class AlignedArray {
 public:
  /// At least `count` zeros.
  void assign_zeros(std::size_t count) { lines_.assign(padded(count) / kLanes, Line{}); }

  [[nodiscard]] double* data() noexcept { return lines_.empty() ? nullptr : lines_[0].values; }
  [[nodiscard]] const double* data() const noexcept {
    return lines_.empty() ? nullptr : lines_[0].values;
  }
  [[nodiscard]] std::size_t size() const noexcept { return lines_.size() * kLanes; }

 private:
  struct alignas(64) Line {
    double values[kLanes] = {};
  };
  std::vector<Line> lines_;
};

}  // namespace sidestep
