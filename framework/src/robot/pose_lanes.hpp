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

/// Where the z axis of one body is, about or along which its joint moves it, in kLanes
/// configurations.
struct alignas(64) AxisLanes {
  double z[3][kLanes];
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

/// The axes of `count` bodies.
void find_axes(const PoseLanes* poses, std::size_t count, AxisLanes* axes) noexcept;

/// The screws of all bodies.
void find_screws(std::span<const TreeBody> bodies, const AxisLanes* axes,
                 ScrewLanes* screws) noexcept;

/// What forces do to each column of a table of screws: six rows of `stride` values, whole lanes,
/// one column for each of as many screws. weights: `stride` values for each body, with which what a
/// force on a link of it does is multiplied. works: forces.size() rows, `step` from one to the
/// next, which are written in whole lanes.
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const double* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept;

}  // namespace sidestep::detail
