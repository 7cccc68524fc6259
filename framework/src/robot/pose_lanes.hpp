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

/// The screw about or along which a joint moves, in kLanes configurations: a force f on what it
/// moves, with moment m about the world's origin, does the work values[0..2] . m + values[3..5] .
/// f.
struct alignas(64) ScrewLanes {
  double values[6][kLanes];
};

/// Poses of all bodies in the configurations of q, `dof` values each and kLanes at most, of which
/// the last stands in for those that are missing.
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  PoseLanes* poses) noexcept;

/// Where spheres are, given the poses of all bodies.
void carry_spheres(std::span<const TreeSphere> spheres, const PoseLanes* poses,
                   PointLanes* centres) noexcept;

/// The screws of all bodies.
void find_screws(std::span<const TreeBody> bodies, const PoseLanes* poses,
                 ScrewLanes* screws) noexcept;

/// What a force does to each column of a table of screws: six rows of `stride` values, whole lanes,
/// one column for each of as many screws, whose works are multiplied with `weights`.
void work_of(const double* force, const double* moment, const double* table, std::size_t stride,
             const double* weights, double* works) noexcept;

}  // namespace sidestep::detail
