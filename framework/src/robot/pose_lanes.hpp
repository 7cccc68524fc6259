#pragma once

#include <span>

#include <sidestep/core/lanes.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::detail {

/// The pose of one body in kLanes configurations, value by value.
struct alignas(64) PoseLanes {
  double R[9][kLanes];  ///< Column by column.
  double p[3][kLanes];
};

/// What a force on a body does to the joint that moves it, in kLanes configurations: about the
/// joint's axis, a force f with moment m about the world's origin has the moment
/// axis . m - offset . f.
struct alignas(64) ScrewLanes {
  double axis[3][kLanes];
  double offset[3][kLanes];  ///< axis x a point of the axis.
};

/// Poses of all bodies in the configurations of q, `dof` values each and kLanes at most, of which
/// the last stands in for those that are missing.
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  PoseLanes* poses) noexcept;

/// Where spheres are, given the poses of all bodies.
void carry_spheres(std::span<const TreeSphere> spheres, const PoseLanes* poses,
                   PointLanes* centres) noexcept;

/// The screws of bodies that turn.
void find_screws(std::span<const PoseLanes> poses, ScrewLanes* screws) noexcept;

}  // namespace sidestep::detail
