#pragma once

#include <span>
#include <type_traits>

#include <sidestep/core/lanes.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::detail {

/// How many numbers, double or float, kernels compute with at once.
template <class Number>
inline constexpr std::size_t kLanesOf = kLanes * sizeof(double) / sizeof(Number);

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

/// As many points as a kernel computes with at once.
template <class Number>
using Points = std::conditional_t<std::is_same_v<Number, double>, PointLanes, PointFloats>;

// Each for double and for float.

/// Poses of all bodies in the configurations of q, `dof` values each and as many at most as the
/// poses have lanes; the last stands in for those that are missing. In single precision angles are
/// reduced in double precision.
template <class Number>
void place_bodies(std::span<const TreeBody> bodies, std::span<const double> q, std::size_t dof,
                  Poses<Number>* poses) noexcept;

/// Where spheres are, given the poses of all bodies.
template <class Number>
void carry_spheres(std::span<const TreeSphere> spheres, const Poses<Number>* poses,
                   Points<Number>* centres) noexcept;

/// The axes of `count` bodies.
template <class Number>
void find_axes(const Poses<Number>* poses, std::size_t count, Axes<Number>* axes) noexcept;

/// The screws of all bodies.
template <class Number>
void find_screws(std::span<const TreeBody> bodies, const Axes<Number>* axes,
                 Screws<Number>* screws) noexcept;

/// What forces do to each column of a table of screws: six rows of `stride` values, whole lanes,
/// one column for each of as many screws. weights: `stride` values for each body, with which what a
/// force on a link of it does is multiplied. works: forces.size() rows, `step` from one to the
/// next, which are written in whole lanes.
template <class Number>
void find_works(std::span<const LinkForce> forces, const int* body_of_link, const Number* table,
                std::size_t stride, const double* weights, double* works,
                std::size_t step) noexcept;

}  // namespace sidestep::detail
