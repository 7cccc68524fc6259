#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "cuda/host_device.hpp"
#include "cuda/team.hpp"

/// How kernels are written. A kernel is a plain struct that holds pointers and sizes, is copied to
/// the device as its argument, and has
///
///     static constexpr int kThreads = 256;   // of a block, a multiple of kWarp
///     static constexpr int kPhases = 2;      // parts between which the threads of a block meet
///     struct Shared { ... };                 // memory of a block, trivially copyable, rubbish at
///     first template <int kPhase> SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread,
///     Shared& shared) const;
///
/// Phase n + 1 of a block begins once phase n of all its threads has ended. Blocks may run in any
/// order, as may the threads of a phase, warps as a whole. A kernel whose phases depend on what it
/// computes has no kPhases, and is written with a Team.
namespace sidestep::cuda {

/// Whether a kernel is written with a Team.
template <class Kernel>
concept TeamKernel = !requires {
  Kernel::kPhases;
};

/// In which order run_on_host() goes through blocks and threads: whatever depends on it is a race.
enum class Order { kForward, kBackward, kShuffled };

namespace detail {

template <class Kernel, int kPhase>
void run_phases(const Kernel& kernel, std::int64_t block, const std::vector<int>& threads,
                typename Kernel::Shared& shared) {
  for (const int thread : threads) kernel.template run<kPhase>(block, thread, shared);
  if constexpr (kPhase + 1 < Kernel::kPhases) {
    run_phases<Kernel, kPhase + 1>(kernel, block, threads, shared);
  }
}

}  // namespace detail

/// Runs a kernel's `blocks` blocks on the calling thread.
template <class Kernel>
void run_on_host(const Kernel& kernel, std::int64_t blocks, Order order = Order::kForward) {
  std::vector<int> threads(Kernel::kThreads);
  std::iota(threads.begin(), threads.end(), 0);
  std::mt19937 random(7);
  if (order == Order::kBackward) std::ranges::reverse(threads);
  typename Kernel::Shared shared;
  for (std::int64_t i = 0; i < blocks; ++i) {
    std::memset(&shared, 0xa5, sizeof(shared));  // whoever reads what nobody wrote shall notice
    if (order == Order::kShuffled) std::ranges::shuffle(threads, random);
    const std::int64_t block = order == Order::kForward ? i : blocks - 1 - i;
    if constexpr (TeamKernel<Kernel>) {
      Team team(threads);
      kernel.run(block, team, shared);
    } else {
      detail::run_phases<Kernel, 0>(kernel, block, threads, shared);
    }
  }
}

}  // namespace sidestep::cuda
