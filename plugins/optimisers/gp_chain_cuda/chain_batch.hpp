#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/error.hpp>

#include "chain_kernels.hpp"
#include "cuda/host_backend.hpp"

namespace sidestep::gp_chain_cuda {

/// What chains have in common, in the host's memory: `problem` without its pointers, and what these
/// are going to point to.
struct ChainDescription {
  ChainProblem problem;
  std::vector<double> inverse_qc;
  std::vector<Interpolation> interpolations;
  std::vector<Body> bodies;
  std::vector<Sphere> spheres;
  std::vector<SpherePair> pairs;
  std::vector<std::int32_t> pair_ends;
  std::vector<double> numbers;
};

/// A block of a field in the host's memory.
struct FieldBlockOnHost {
  std::int32_t block = 0;
  const float* distances_m = nullptr;    ///< PlaceBlocks::kVoxels.
  const std::uint16_t* known = nullptr;  ///< PlaceBlocks::kRows.
};

/// Samples of the prior that chains may stray by; as PriorSamples has them.
struct SamplesOnHost {
  std::vector<PriorStep> steps;
  std::vector<double> deviations;
  /// The same numbers as in the last batch where this has not changed, and their size not either.
  std::uint64_t version = 0;
  std::span<const double> normals;
  std::int64_t stride = 0;
};

/// One chain as it begins.
struct ChainStart {
  std::span<const double> trajectory;  ///< Of its support states, [q; qdot] each; ends in place.
  std::span<const double> numbers;     ///< Its own, problem.own_numbers.
  int sample = 0;                      ///< Number of the sample to be added, from 1; 0 for none.
};

/// What became of a batch. Valid until the next call of anything.
struct BatchOutcome {
  std::span<const ChainState> states;
  std::span<const double> trajectories;  ///< problem.values() each.
};

/// Many chains, minimised at once. For one thread at a time. Everything fails where the device
/// does; the batch is then of no more use.
class ChainBatch {
 public:
  virtual ~ChainBatch() = default;

  /// The field that the next batches see: `shape` without its pointers, and the blocks that are
  /// other ones than before, all of them where the size is.
  [[nodiscard]] virtual Result<void> set_field(const FieldOnDevice& shape,
                                               std::span<const FieldBlockOnHost> blocks) = 0;

  /// Takes up a batch. Fails with kUnsupported where it is too large for the device's memory.
  [[nodiscard]] virtual Result<void> begin(const ChainDescription& description,
                                           const MinimisationRules& rules,
                                           std::span<const ChainStart> starts,
                                           const SamplesOnHost& samples) = 0;
  /// Goes on by up to so many accepted steps of each chain, and returns how many chains have not
  /// ended.
  [[nodiscard]] virtual Result<int> move(int iterations) = 0;
  [[nodiscard]] virtual Result<BatchOutcome> outcome() = 0;
  /// What the terms of a chain cost: that of the GP prior, then of each term of the problem.
  [[nodiscard]] virtual Result<std::vector<double>> term_costs(int chain) = 0;

  /// How long the stages of the newest of these took; kIntegrate stands for set_field()'s kernel,
  /// kTransform for the minimisation.
  [[nodiscard]] virtual const cuda::StageTimes& times() const noexcept = 0;
};

/// One that runs on a CUDA device. Fails with kPlugin where it cannot be used.
[[nodiscard]] Result<std::unique_ptr<ChainBatch>> make_device_batch(int ordinal);

/// One whose kernels run on the host, one thread after the other, for tests.
[[nodiscard]] Result<std::unique_ptr<ChainBatch>> make_host_batch(cuda::HostBackend backend);

}  // namespace sidestep::gp_chain_cuda
