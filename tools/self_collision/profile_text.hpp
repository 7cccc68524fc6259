#pragma once

#include <string>
#include <vector>

#include "pair_statistics.hpp"

namespace sidestep {

/// The profile's `self_collision` block that checks these pairs.
[[nodiscard]] std::string self_collision_block(const RobotDescription& robot,
                                               const std::vector<PairStatistics>& pairs,
                                               const SamplingOptions& options);

/// A profile's text with its `self_collision` block replaced, or with one at its end. All else,
/// comments included, stays as it is.
[[nodiscard]] std::string with_self_collision(const std::string& profile, const std::string& block);

}  // namespace sidestep
