#include <sidestep/core/instruction_set.hpp>

#include <algorithm>
#include <cstdlib>
#include <string_view>

namespace sidestep {
namespace {

InstructionSet of_processor() noexcept {
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
  if (__builtin_cpu_supports("x86-64-v4")) return InstructionSet::kAvx512;
  if (__builtin_cpu_supports("x86-64-v3")) return InstructionSet::kAvx2;
#endif
  return InstructionSet::kAny;
}

}  // namespace

InstructionSet best_instruction_set() noexcept {
  const char* const asked = std::getenv("SIDESTEP_INSTRUCTIONS");
  const std::string_view name = asked != nullptr ? asked : "";
  if (name == "any") return InstructionSet::kAny;
  if (name == "avx2") return std::min(of_processor(), InstructionSet::kAvx2);
  return of_processor();
}

}  // namespace sidestep
