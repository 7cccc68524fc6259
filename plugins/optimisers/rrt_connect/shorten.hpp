#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/time.hpp>

#include "checker.hpp"
#include "steering.hpp"

namespace sidestep::rrt_connect {

/// How a path is shortened.
struct Shortening {
  std::vector<double> weights;  ///< Of joints, in lengths: of dof() values.
  double resolution_m = 0.005;  ///< Of Checker.
  int tries = 30;               ///< Stretches that are tried.
  joint_paths::Steering steering;
};

/// The sum of the Euclidean lengths, each joint's way times its weight, of a path of
/// weights.size() values a vertex.
[[nodiscard]] double path_length(std::span<const double> path, std::span<const double> weights);

/// Shortens a path that is clear, and keeps it so and its ends. Vertices are left out; then random
/// stretches are drawn straight, in one joint (partial short cuts: Geraerts and Overmars, IJRR
/// 2007) or in all; of a rolling base as it gets there, if that is shorter. Allocates.
void shorten(std::vector<double>& path, const Shortening& how, joint_paths::Checker& checker,
             std::uint64_t seed, const Deadline& deadline);

}  // namespace sidestep::rrt_connect
