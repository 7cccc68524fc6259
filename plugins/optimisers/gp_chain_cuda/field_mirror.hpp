#pragma once

#include <memory>
#include <vector>

#include <sidestep/field/dense_field.hpp>

#include "chain_batch.hpp"

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

}  // namespace sidestep::gp_chain_cuda
