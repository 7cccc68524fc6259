#pragma once

#include <span>

#include <sidestep/planning/state_normals.hpp>
#include <sidestep/trajectory/gp_prior.hpp>

#include "chain_system.hpp"

namespace sidestep {

/// Adds the normal equations of a support state's own costs.
void add_support_state(const StateNormals& normals, std::size_t state, ChainSystem& system,
                       int support);

/// Adds those of the states interpolated between support states i and i + 1. With
/// x(t) = Lambda x_i + Psi x_{i+1}, a block G of positions enters the blocks of
/// z = (q_i, qdot_i, q_{i+1}, qdot_{i+1}) as c_m c_n G, c = [Lambda11 Lambda12 Psi11 Psi12]
/// (docs/numerics.md). The interval's states share the ten sums over their c_m c_n.
/// `first`: the first of them in `normals`.
void add_interval(const StateNormals& normals, std::size_t first,
                  std::span<const GpPrior::Interpolation> checks, ChainSystem& system,
                  int interval);

/// The block of H with the rows of z_m and the columns of z_n, m >= n; columns
/// stride() apart.
[[nodiscard]] double* interval_block(ChainSystem& system, int interval, std::size_t m,
                                     std::size_t n, std::size_t dof) noexcept;
/// The part of b of z_m.
[[nodiscard]] double* interval_rhs(ChainSystem& system, int interval, std::size_t m,
                                   std::size_t dof) noexcept;

/// One interpolated state from the two support states around it: their positions and velocities,
/// four rows of whole lanes. Writes whole lanes too.
void interpolate_between(const double* ends, std::size_t stride,
                         const GpPrior::Interpolation& interpolation, double* q,
                         double* qdot) noexcept;

}  // namespace sidestep
