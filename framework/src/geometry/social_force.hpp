#pragma once

#include <span>

#include <sidestep/geometry/orca.hpp>

namespace sidestep {

/// Helbing and Molnar 1995, with circles for ellipses: the acceleration towards the preferred
/// velocity, away from others and from walls; what is behind counts half.
[[nodiscard]] Eigen::Vector2d social_force(const OrcaAgent& self,
                                           const Eigen::Vector2d& preferred_mps,
                                           std::span<const OrcaAgent> others,
                                           std::span<const OrcaWall> walls);

}  // namespace sidestep
