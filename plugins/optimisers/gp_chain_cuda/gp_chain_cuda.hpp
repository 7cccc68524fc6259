#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/field/dense_field.hpp>

#include "chain_batch.hpp"
#include "gp_chain.hpp"

namespace sidestep::gp_chain_cuda {

/// Keeps the field of a batch the same as snapshots in the host's memory: blocks that a snapshot
/// shares with the one before are not sent again.
class FieldMirror {
 public:
  /// Sends what is new. `shape`: of `field`, without pointers.
  [[nodiscard]] Result<void> show(ChainBatch& batch, const FieldOnDevice& shape,
                                  const DenseField& field);

  /// Blocks that the newest snapshot took.
  [[nodiscard]] std::size_t sent() const noexcept { return changed_.size(); }

 private:
  DenseField::Blocks blocks_;  ///< As sent; kept, so that no other block has the same address.
  DenseField::KnownBlocks known_;
  std::vector<FieldBlockOnHost> changed_;
};

/// Of gp_chain's settings those of Levenberg-Marquardt; and where it runs.
struct Options : GpChainSettings {
  int device = 0;
  std::string fallback = "none";

  Options() { starts = 64; }

  static Parameters<Options> parameters() {
    return declare_minimisation(Parameters<Options>(), 65536.0)
        .add("device", &Options::device, "Number of the CUDA device, counted from 0.", {.min = 0})
        .add("fallback", &Options::fallback,
             "What happens where the device cannot be used, is lost, or does not know a cost of "
             "the problem: none: an error; cpu: the run goes on with gp_chain, and the log says "
             "so.",
             {.choices = {"none", "cpu"}});
  }
};

/// A way to make a batch.
using MakeBatch = std::function<Result<std::unique_ptr<ChainBatch>>()>;

/// gp_chain's solution of a problem from many starts, all minimised at once by a batch that `make`
/// makes. `workers` (of the fallback; or null) and `log` outlive it; `seed` is of the starts.
/// Fails where the batch does, and settings.fallback is none.
[[nodiscard]] Result<std::unique_ptr<Optimiser>> make_gp_chain_cuda(const Options& settings,
                                                                    WorkerPool* workers, Log& log,
                                                                    std::uint64_t seed,
                                                                    const MakeBatch& make);

}  // namespace sidestep::gp_chain_cuda
