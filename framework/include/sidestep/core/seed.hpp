#pragma once

#include <cstdint>
#include <string_view>

namespace sidestep {

/// A seed for one named part of a run, drawn from the run's seed, so that adding a part
/// never changes the random numbers of another. FNV-1a of the name, mixed by SplitMix64.
[[nodiscard]] std::uint64_t derive_seed(std::uint64_t run_seed, std::string_view part) noexcept;

}  // namespace sidestep
