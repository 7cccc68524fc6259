#pragma once

#include <sidestep/core/export.hpp>

namespace sidestep {

/// What kernels are compiled for (core/each_target.hpp).
enum class InstructionSet { kAny, kAvx2, kAvx512 };

/// The best that the processor has, or the lesser one that the environment variable
/// SIDESTEP_INSTRUCTIONS names: any, avx2 or avx512. [any]
[[nodiscard]] SIDESTEP_EXPORT InstructionSet best_instruction_set() noexcept;

}  // namespace sidestep
