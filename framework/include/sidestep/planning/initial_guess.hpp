#pragma once

#include <cstdint>

#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// The straight line from a problem's start to its goal, at its support states.
[[nodiscard]] Trajectory straight_line(const Problem& problem);

/// The first guess of a solve. Attempt 0: the straight line. Later ones: the straight line bent
/// by a few smooth random waves, larger with every attempt, inside the joints' limits, with
/// start and goal where they were; the same for the same seed and attempt.
[[nodiscard]] Trajectory initial_guess(const Problem& problem, int attempt, std::uint64_t seed);

}  // namespace sidestep
