#pragma once

#include "assembly.hpp"
#include "chains.hpp"
#include "cuda/team.hpp"

/// The kernels of a batch beside MoveChains.
namespace sidestep::gp_chain_cuda {

/// What each term of some chains costs: that of the GP prior, then of each term of the problem.
template <int kMaxDof>
struct PriceTerms {
  static constexpr int kThreads = 128;
  struct Shared {
    double sums[kThreads];
  };

  ChainProblem problem;
  Chains chains;
  const std::int32_t* asked = nullptr;  ///< Numbers of the chains.
  double* costs = nullptr;              ///< 1 + problem.terms of each.

  SIDESTEP_HOST_DEVICE void run(std::int64_t block, cuda::Team& team, Shared& shared) const {
    const double* support = chains.at(asked[block], problem).support;
    const double* own_numbers = chains.numbers(asked[block], problem);
    double* const out = costs + block * (1 + problem.terms);
    const double prior = team.sum(
        shared.sums, [&](int thread) { return prior_cost(problem, support, thread, kThreads); });
    team.each([&](int thread) {
      if (thread == 0) out[0] = prior;
    });
    for (int t = 0; t < problem.terms; ++t) {
      const double of_term = team.sum(shared.sums, [&](int thread) {
        double cost = 0.0;
        for (int i = thread; i < problem.all_states(); i += kThreads) {
          if (!applies(problem.term[t], problem, i)) continue;
          StateOnChain<kMaxDof> at(problem, own_numbers, support, i);
          cost += at.add(problem.term[t]);
        }
        return cost;
      });
      team.each([&](int thread) {
        if (thread == 0) out[1 + t] = of_term;
      });
    }
  }
};

/// Copies trajectories, one after the other, from or to the chains' memory.
struct CopyTrajectories {
  static constexpr int kThreads = 128;
  static constexpr int kPhases = 1;
  struct Shared {};

  ChainProblem problem;
  Chains chains;
  double* trajectories = nullptr;
  bool is_to_chains = false;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t chain, int thread, Shared&) const {
    double* support = chains.at(chain, problem).support;
    double* trajectory = trajectories + chain * problem.values();
    for (int i = thread; i < problem.values(); i += kThreads) {
      (is_to_chains ? support : trajectory)[i] = (is_to_chains ? trajectory : support)[i];
    }
  }
};

/// Puts blocks of a field where they belong.
struct PlaceBlocks {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 1;
  static constexpr int kVoxels = 4096;
  static constexpr int kRows = 256;
  struct Shared {};

  const std::int32_t* blocks = nullptr;
  const float* distances_m = nullptr;
  const std::uint16_t* known = nullptr;
  float* field_m = nullptr;
  std::uint16_t* field_known = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t item, int thread, Shared&) const {
    const std::ptrdiff_t to = blocks[item];
    for (int v = thread; v < kVoxels; v += kThreads) {
      field_m[to * kVoxels + v] = distances_m[item * kVoxels + v];
    }
    field_known[to * kRows + thread] = known[item * kRows + thread];
  }
};

}  // namespace sidestep::gp_chain_cuda
