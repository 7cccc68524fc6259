#pragma once

#include <span>

#include <sidestep/core/lanes.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::detail {

/// How many numbers, double or float, kernels compute with at once.
template <class Number>
inline constexpr std::size_t kLanesOf = sizeof(Lanes) / sizeof(Number);

/// The pose of one body in as many configurations, value by value.
template <class Number>
struct alignas(64) Poses {
  Number R[9][kLanesOf<Number>];  ///< Column by column.
  Number p[3][kLanesOf<Number>];
};

/// Where the z axis of one body is, about or along which its joint moves it.
template <class Number>
struct alignas(64) Axes {
  Number z[3][kLanesOf<Number>];
  Number p[3][kLanesOf<Number>];
};

/// The screw about or along which a joint moves: a force f on what it moves, with moment m about
/// the world's origin, does the work values[0..2] . m + values[3..5] . f.
template <class Number>
struct alignas(64) Screws {
  Number values[6][kLanesOf<Number>];
};

/// Poses of all bodies in the configurations of q, `dof` values each and as many at most as the
/// poses have lanes; the last stands in for those that are missing. In single precision angles are
/// reduced in double precision.
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  Poses<double>* poses) noexcept;
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  Poses<float>* poses) noexcept;

/// Where spheres are, given the poses of all bodies.
void carry_spheres(std::span<const TreeSphere> spheres, const Poses<double>* poses,
                   PointLanes* centres) noexcept;
void carry_spheres(std::span<const TreeSphere> spheres, const Poses<float>* poses,
                   PointFloats* centres) noexcept;

/// The axes of `count` bodies.
void find_axes(const Poses<double>* poses, std::size_t count, Axes<double>* axes) noexcept;
void find_axes(const Poses<float>* poses, std::size_t count, Axes<float>* axes) noexcept;

/// The screws of all bodies.
void find_screws(std::span<const TreeBody> bodies, const Axes<double>* axes,
                 Screws<double>* screws) noexcept;
void find_screws(std::span<const TreeBody> bodies, const Axes<float>* axes,
                 Screws<float>* screws) noexcept;

/// What forces do to each column of a table of screws: six rows of `stride` values, whole lanes,
/// one column for each of as many screws. weights: `stride` values for each body, with which what a
/// force on a link of it does is multiplied. works: forces.size() rows, `step` from one to the
/// next, which are written in whole lanes.
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const double* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept;
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const float* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept;

}  // namespace sidestep::detail
