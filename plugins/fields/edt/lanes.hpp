#pragma once

#include <cstdint>

// Compiles a function for the baseline and for AVX2; which one runs is chosen when the library is
// loaded. Sanitizers intercept the resolver before they are ready, so they get the baseline.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SIDESTEP_SIMD_CLONES [[gnu::target_clones("avx2", "default")]]
#else
#define SIDESTEP_SIMD_CLONES
#endif

namespace sidestep::edt {

/// 16 values of 16 bits, and 8 of 32, on which operators work lane by lane; a comparison is all
/// ones where it holds. A vector extension of GCC and Clang: g++ 12 unrolls plain loops over 16
/// values before it could vectorise them, which takes five times as long. Pointers to them may
/// alias and need no alignment. Not to be passed by value: how that is done depends on the target.
using Lanes16 = std::uint16_t __attribute__((vector_size(32), aligned(2), may_alias));
using Lanes32 = std::uint32_t __attribute__((vector_size(32), aligned(4), may_alias));
using Lanes64 = std::uint64_t __attribute__((vector_size(32)));

}  // namespace sidestep::edt
