#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include <sidestep/core/lanes.hpp>

// What kernels compute with that are compiled once for each instruction set (each_target.hpp).

namespace sidestep {

/// Numbers that are computed with at once, read and written at any multiple of a number's size.
template <class Number, std::size_t kBytes>
struct VectorOf;
#define SIDESTEP_VECTOR(Number, bytes)                                                            \
  template <>                                                                                     \
  struct VectorOf<Number, bytes> {                                                                \
    using Type = Number __attribute__((vector_size(bytes), aligned(alignof(Number)), may_alias)); \
  };
#define SIDESTEP_VECTORS(bytes)         \
  SIDESTEP_VECTOR(double, bytes)        \
  SIDESTEP_VECTOR(float, bytes)         \
  SIDESTEP_VECTOR(std::int64_t, bytes)  \
  SIDESTEP_VECTOR(std::uint32_t, bytes) \
  SIDESTEP_VECTOR(std::int32_t, bytes)
SIDESTEP_VECTORS(16)
SIDESTEP_VECTORS(32)
SIDESTEP_VECTORS(64)
#undef SIDESTEP_VECTORS
#undef SIDESTEP_VECTOR

/// As many numbers as a cache line holds, in `kParts` vectors of the processor's: g++ 12 keeps
/// longer ones in memory (docs/decisions/0007-clones-by-instructions.md).
template <class Number, std::size_t kParts>
struct Line {
  using Part = typename VectorOf<Number, 64 / kParts>::Type;
  static constexpr std::size_t kInPart = 64 / kParts / sizeof(Number);
  static constexpr std::size_t kCount = kParts * kInPart;
  Part parts[kParts];

  SIDESTEP_INLINE Number operator[](std::size_t i) const noexcept {
    return parts[i / kInPart][i % kInPart];
  }
};

/// What comparing numbers gives: all bits set, or none.
template <class Number, std::size_t kParts>
using Mask = Line<std::conditional_t<sizeof(Number) == 8, std::int64_t, std::int32_t>, kParts>;

#define SIDESTEP_EACH_PART _Pragma("GCC unroll 4") for (std::size_t i = 0; i < kParts; ++i)
#define SIDESTEP_OPERATOR(op, Result)                                                           \
  template <class Number, std::size_t kParts>                                                   \
  SIDESTEP_INLINE Result<Number, kParts> operator op(const Line<Number, kParts>& a,             \
                                                     const Line<Number, kParts>& b) noexcept {  \
    Result<Number, kParts> out;                                                                 \
    SIDESTEP_EACH_PART out.parts[i] =                                                           \
        (typename Result<Number, kParts>::Part)(a.parts[i] op b.parts[i]);                      \
    return out;                                                                                 \
  }                                                                                             \
  template <class Number, std::size_t kParts>                                                   \
  SIDESTEP_INLINE Result<Number, kParts> operator op(const Line<Number, kParts>& a,             \
                                                     std::type_identity_t<Number> b) noexcept { \
    Result<Number, kParts> out;                                                                 \
    SIDESTEP_EACH_PART out.parts[i] = (typename Result<Number, kParts>::Part)(a.parts[i] op b); \
    return out;                                                                                 \
  }                                                                                             \
  template <class Number, std::size_t kParts>                                                   \
  SIDESTEP_INLINE Result<Number, kParts> operator op(std::type_identity_t<Number> a,            \
                                                     const Line<Number, kParts>& b) noexcept {  \
    Result<Number, kParts> out;                                                                 \
    SIDESTEP_EACH_PART out.parts[i] = (typename Result<Number, kParts>::Part)(a op b.parts[i]); \
    return out;                                                                                 \
  }
#define SIDESTEP_ARITHMETIC(op)                                                   \
  SIDESTEP_OPERATOR(op, Line)                                                     \
  template <class Number, std::size_t kParts, class Other>                        \
  SIDESTEP_INLINE Line<Number, kParts>& operator op##=(Line<Number, kParts>& a,   \
                                                       const Other& b) noexcept { \
    return a = a op b;                                                            \
  }
SIDESTEP_ARITHMETIC(+)
SIDESTEP_ARITHMETIC(-)
SIDESTEP_ARITHMETIC(*)
SIDESTEP_ARITHMETIC(/)
SIDESTEP_ARITHMETIC(&)
SIDESTEP_ARITHMETIC(|)
SIDESTEP_ARITHMETIC(^)
SIDESTEP_ARITHMETIC(<<)
SIDESTEP_ARITHMETIC(>>)
SIDESTEP_OPERATOR(<, Mask)
SIDESTEP_OPERATOR(>, Mask)
SIDESTEP_OPERATOR(<=, Mask)
SIDESTEP_OPERATOR(==, Mask)
SIDESTEP_OPERATOR(!=, Mask)
#undef SIDESTEP_ARITHMETIC
#undef SIDESTEP_OPERATOR

template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> operator-(const Line<Number, kParts>& a) noexcept {
  Line<Number, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] = -a.parts[i];
  return out;
}

/// a where a comparison holds, else b.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> choose(
    const std::type_identity_t<Mask<Number, kParts>>& holds, const Line<Number, kParts>& a,
    const std::type_identity_t<Line<Number, kParts>>& b) noexcept {
  Line<Number, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] = holds.parts[i] ? a.parts[i] : b.parts[i];
  return out;
}
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> choose(const std::type_identity_t<Mask<Number, kParts>>& holds,
                                            const Line<Number, kParts>& a,
                                            std::type_identity_t<Number> b) noexcept {
  return choose(holds, a, Line<Number, kParts>{} + b);
}

/// The lesser and the greater of two numbers each; b where a is none. Not by choose(): of integers
/// g++ 12 makes an instruction of this form alone.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> lesser(const Line<Number, kParts>& a,
                                            const Line<Number, kParts>& b) noexcept {
  Line<Number, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] = a.parts[i] < b.parts[i] ? a.parts[i] : b.parts[i];
  return out;
}
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> greater(const Line<Number, kParts>& a,
                                             const Line<Number, kParts>& b) noexcept {
  Line<Number, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] = a.parts[i] > b.parts[i] ? a.parts[i] : b.parts[i];
  return out;
}

/// Absolute values.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> abs(const Line<Number, kParts>& values) noexcept {
  return choose(values < Number{}, -values, values);
}

/// The sum over all lanes.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Number sum_of(const Line<Number, kParts>& values) noexcept {
  Number sum{};
  for (std::size_t i = 0; i < values.kCount; ++i) sum += values[i];
  return sum;
}

/// The least of all lanes.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Number least_of(const Line<Number, kParts>& values) noexcept {
  Number least = values[0];
  for (std::size_t i = 1; i < values.kCount; ++i) least = lesser(least, values[i]);
  return least;
}

/// 1 where a comparison holds, else 0.
template <std::size_t kParts>
SIDESTEP_INLINE Line<double, kParts> ones_where(const Line<std::int64_t, kParts>& holds) noexcept {
  return choose(holds, Line<double, kParts>{} + 1.0, 0.0);
}

/// Whether any lane is something else than 0; no lane may be negative.
template <std::size_t kParts>
SIDESTEP_INLINE bool any_of(const Line<double, kParts>& values) noexcept {
  using Quarter = VectorOf<double, 16>::Type;
  const auto* quarters = reinterpret_cast<const Quarter*>(&values);
  const Quarter sum = (quarters[0] + quarters[1]) + (quarters[2] + quarters[3]);
  return sum[0] + sum[1] != 0.0;
}

/// 0, 1, 2, ...
template <class Integer, std::size_t kParts>
SIDESTEP_INLINE void count_lanes(Line<Integer, kParts>& out) noexcept {
  alignas(64) Integer numbers[Line<Integer, kParts>::kCount];
  for (std::size_t i = 0; i < out.kCount; ++i) numbers[i] = static_cast<Integer>(i);
  out = *reinterpret_cast<const Line<Integer, kParts>*>(numbers);
}

/// Numbers as the bits that they consist of.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Mask<Number, kParts> bits_of(const Line<Number, kParts>& values) noexcept {
  Mask<Number, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] = (typename Mask<Number, kParts>::Part)(values.parts[i]);
  return out;
}
/// Numbers with some of their bits inverted.
template <class Number, std::size_t kParts>
SIDESTEP_INLINE Line<Number, kParts> inverted(
    const Line<Number, kParts>& values,
    const std::type_identity_t<Mask<Number, kParts>>& bits) noexcept {
  Line<Number, kParts> out;
  const Mask<Number, kParts> changed = bits_of(values) ^ bits;
  SIDESTEP_EACH_PART out.parts[i] = (typename Line<Number, kParts>::Part)(changed.parts[i]);
  return out;
}

/// Integer parts, towards zero, and back.
template <std::size_t kParts>
SIDESTEP_INLINE Line<std::int32_t, kParts> integers_of(const Line<float, kParts>& values) noexcept {
  Line<std::int32_t, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] =
      __builtin_convertvector(values.parts[i], typename Line<std::int32_t, kParts>::Part);
  return out;
}
template <std::size_t kParts>
SIDESTEP_INLINE Line<float, kParts> floats_of(const Line<std::int32_t, kParts>& values) noexcept {
  Line<float, kParts> out;
  SIDESTEP_EACH_PART out.parts[i] =
      __builtin_convertvector(values.parts[i], typename Line<float, kParts>::Part);
  return out;
}

/// Eight numbers that are half as long as a double, in memory, to and from doubles.
template <class Half, std::size_t kParts>
SIDESTEP_INLINE void read_halves(const Half* from, Line<double, kParts>& out) noexcept {
  static_assert(sizeof(Half) == 4);
  if constexpr (kParts <= 2) {
    using Part = typename VectorOf<Half, 32 / kParts>::Type;
    SIDESTEP_EACH_PART out.parts[i] = __builtin_convertvector(
        reinterpret_cast<const Part*>(from)[i], typename Line<double, kParts>::Part);
  } else {
    alignas(64) double numbers[kLanes];
    for (std::size_t i = 0; i < kLanes; ++i) numbers[i] = static_cast<double>(from[i]);
    out = *reinterpret_cast<const Line<double, kParts>*>(numbers);
  }
}
template <class Half, std::size_t kParts>
SIDESTEP_INLINE void write_halves(const Line<double, kParts>& values, Half* to) noexcept {
  static_assert(sizeof(Half) == 4);
  if constexpr (kParts <= 2) {
    using Part = typename VectorOf<Half, 32 / kParts>::Type;
    SIDESTEP_EACH_PART reinterpret_cast<Part*>(to)[i] =
        __builtin_convertvector(values.parts[i], Part);
  } else {
    for (std::size_t i = 0; i < kLanes; ++i) to[i] = static_cast<Half>(values[i]);
  }
}

/// Integers, as many as there are doubles in a line.
using HalfIntegers = VectorOf<std::int32_t, 32>::Type;

/// Integer parts, towards zero.
template <std::size_t kParts>
SIDESTEP_INLINE void truncate(const Line<double, kParts>& values, HalfIntegers& out) noexcept {
  if constexpr (kParts == 1) {
    out = __builtin_convertvector(values.parts[0], HalfIntegers);
  } else if constexpr (kParts == 2) {
    using Half = VectorOf<std::int32_t, 16>::Type;
    const Half low = __builtin_convertvector(values.parts[0], Half);
    const Half high = __builtin_convertvector(values.parts[1], Half);
    out = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
  } else {
    write_halves(values, reinterpret_cast<std::int32_t*>(&out));
  }
}
template <std::size_t kParts>
SIDESTEP_INLINE void find_numbers(const HalfIntegers& values, Line<double, kParts>& out) noexcept {
  using Part = typename Line<double, kParts>::Part;
  if constexpr (kParts == 1) {
    out.parts[0] = __builtin_convertvector(values, Part);
  } else if constexpr (kParts == 2) {
    out.parts[0] =
        __builtin_convertvector(__builtin_shufflevector(values, values, 0, 1, 2, 3), Part);
    out.parts[1] =
        __builtin_convertvector(__builtin_shufflevector(values, values, 4, 5, 6, 7), Part);
  } else {
    read_halves(reinterpret_cast<const std::int32_t*>(&values), out);
  }
}

/// The first and the second of eight pairs.
template <std::size_t kParts>
SIDESTEP_INLINE void part_pairs(const float (&pairs)[kLanes][2], Line<double, kParts>& firsts,
                                Line<double, kParts>& seconds) noexcept {
  using Part = typename Line<double, kParts>::Part;
  const auto& all = reinterpret_cast<const Line<float, kParts>&>(pairs);
  if constexpr (kParts == 1) {
    const auto& p = all.parts[0];
    firsts.parts[0] =
        __builtin_convertvector(__builtin_shufflevector(p, p, 0, 2, 4, 6, 8, 10, 12, 14), Part);
    seconds.parts[0] =
        __builtin_convertvector(__builtin_shufflevector(p, p, 1, 3, 5, 7, 9, 11, 13, 15), Part);
  } else if constexpr (kParts == 2) {
#pragma GCC unroll 2
    for (std::size_t i = 0; i < kParts; ++i) {
      const auto& p = all.parts[i];
      firsts.parts[i] = __builtin_convertvector(__builtin_shufflevector(p, p, 0, 2, 4, 6), Part);
      seconds.parts[i] = __builtin_convertvector(__builtin_shufflevector(p, p, 1, 3, 5, 7), Part);
    }
  } else {
    alignas(64) double a[kLanes], b[kLanes];
    for (std::size_t i = 0; i < kLanes; ++i) {
      a[i] = static_cast<double>(pairs[i][0]);
      b[i] = static_cast<double>(pairs[i][1]);
    }
    firsts = *reinterpret_cast<const Line<double, kParts>*>(a);
    seconds = *reinterpret_cast<const Line<double, kParts>*>(b);
  }
}

}  // namespace sidestep
