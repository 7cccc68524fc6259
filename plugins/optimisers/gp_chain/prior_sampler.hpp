#pragma once

#include <cstdint>
#include <span>

#include <sidestep/planning/problem.hpp>

#include "chain_system.hpp"
#include "prior_chain.hpp"

namespace sidestep {

/// Draws how far a motion strays from another one between the same two states: samples of a
/// problem's GP prior with both ends held. With Qc q and T between the ends, half way a position
/// strays by sqrt(q T^3 / 192) in the mean square.
class PriorSampler {
 public:
  void reset(const Problem& problem);

  /// A sample: [q; qdot] of each support state, one after the other, zero at both ends. Equal seeds
  /// draw equal samples.
  void draw(std::uint64_t seed, std::span<double> out);

 private:
  ChainSystem system_;
};

}  // namespace sidestep
