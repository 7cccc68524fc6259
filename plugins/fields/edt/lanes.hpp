#pragma once

#include <cstdint>

#include <sidestep/core/lanes.hpp>

#define SIDESTEP_AVX2_CLONES SIDESTEP_CLONES_FOR("avx2", "default")
#define SIDESTEP_AVX512_CLONES SIDESTEP_CLONES_FOR("avx512f", "avx2", "default")

namespace sidestep::edt {

/// 16 values, of 16 bits and of 32, on which operators work lane by lane; a comparison is all
/// ones where it holds. A vector extension of GCC and Clang: g++ 12 unrolls plain loops over 16
/// values before it could vectorise them, which takes five times as long. Pointers to them may
/// alias and need no alignment. Not to be passed by value: how that is done depends on the target.
using Lanes16 = std::uint16_t __attribute__((vector_size(32), aligned(2), may_alias));
using Lanes32 = std::uint32_t __attribute__((vector_size(64), aligned(4), may_alias));

/// Whether any lane of a comparison holds.
SIDESTEP_INLINE bool any(const Lanes16& comparison) {
  using Words = std::uint64_t __attribute__((vector_size(32)));
  const auto words = (Words)comparison;
  return (words[0] | words[1] | words[2] | words[3]) != 0;
}
SIDESTEP_INLINE bool any(const Lanes32& comparison) {
  using Words = std::uint64_t __attribute__((vector_size(64)));
  const auto words = (Words)comparison;
  return (words[0] | words[1] | words[2] | words[3] | words[4] | words[5] | words[6] | words[7]) !=
         0;
}

}  // namespace sidestep::edt
