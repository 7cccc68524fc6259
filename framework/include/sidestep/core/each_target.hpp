// Compiles the file SIDESTEP_KERNELS once for each instruction set, in a namespace of its own each;
// SIDESTEP_DISPATCH(f) is the f for the processor that it runs on. What is included sees Lanes and
// FloatLanes of as many vectors as suit, and lanes() of memory. A source file that has kernels
// includes this once, and names itself:
//
//     #ifndef SIDESTEP_KERNELS
//     #define SIDESTEP_KERNELS "this_file.cpp"
//     #include <sidestep/core/each_target.hpp>
//     namespace sidestep {
//     void scale(double* values) { SIDESTEP_DISPATCH(scale)(values); }
//     }
//     #else
//     void scale(double* values) { lanes(values) *= 2.0; }
//     #endif
#include <sidestep/core/instruction_set.hpp>
#include <sidestep/core/vectors.hpp>

#define SIDESTEP_TARGET(name, parts)                                                          \
  namespace sidestep::name {                                                                  \
  inline constexpr std::size_t kParts = parts;                                                \
  using Lanes = Line<double, kParts>;                                                         \
  using FloatLanes = Line<float, kParts>;                                                     \
  SIDESTEP_INLINE Lanes& lanes(double* at) noexcept { return *reinterpret_cast<Lanes*>(at); } \
  SIDESTEP_INLINE const Lanes& lanes(const double* at) noexcept {                             \
    return *reinterpret_cast<const Lanes*>(at);                                               \
  }                                                                                           \
  SIDESTEP_INLINE FloatLanes& lanes(float* at) noexcept {                                     \
    return *reinterpret_cast<FloatLanes*>(at);                                                \
  }                                                                                           \
  SIDESTEP_INLINE const FloatLanes& lanes(const float* at) noexcept {                         \
    return *reinterpret_cast<const FloatLanes*>(at);                                          \
  }                                                                                           \
  }

SIDESTEP_TARGET(for_any, 4)
namespace sidestep::for_any {
#include SIDESTEP_KERNELS
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v3")
SIDESTEP_TARGET(for_avx2, 2)
namespace sidestep::for_avx2 {
#include SIDESTEP_KERNELS
}
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("arch=x86-64-v4")
SIDESTEP_TARGET(for_avx512, 1)
namespace sidestep::for_avx512 {
#include SIDESTEP_KERNELS
}
#pragma GCC pop_options

namespace sidestep {
inline const InstructionSet kInstructionSet = best_instruction_set();
}  // namespace sidestep
#define SIDESTEP_DISPATCH(...)                                          \
  (kInstructionSet == InstructionSet::kAvx512 ? for_avx512::__VA_ARGS__ \
   : kInstructionSet == InstructionSet::kAvx2 ? for_avx2::__VA_ARGS__   \
                                              : for_any::__VA_ARGS__)
#else
#define SIDESTEP_DISPATCH(...) for_any::__VA_ARGS__
#endif
