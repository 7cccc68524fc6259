#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/worker_pool.hpp>
#include <sidestep/field/dense_field.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

/// Publishes dense fields block by block: what a FieldBuilder needs to hand out snapshots that
/// share whatever did not change. Blocks of one value throughout share one block. [mapping]
class DenseFieldPublisher {
 public:
  /// Writes the distances of `count` voxels of row (y, z) from x on. Called from the worker
  /// pool, for different rows at once.
  using RowWriter = std::function<void(int x, int y, int z, int count, float* distances_m)>;

  /// `view` says which voxels are known; it and `workers` outlive the publisher. `info` has
  /// everything but sequence and stamp.
  DenseFieldPublisher(FieldInfo info, const OccupancyView& view, WorkerPool& workers);

  /// Starts an update. Returns one flag a block, in block_linear order; all set before the first
  /// publication, else those of the update. What the builder finds changed beyond them it sets
  /// as well. Fails with kInvalidArgument where the update is not the next one, or names blocks
  /// that the grid does not have.
  [[nodiscard]] Result<std::vector<std::uint8_t>> begin(const MapUpdate& update);

  /// A snapshot in which the flagged blocks are written anew. Blocks that come out equal stay
  /// shared with the snapshot before.
  [[nodiscard]] std::shared_ptr<const DistanceField> publish(
      const MapUpdate& update, const std::vector<std::uint8_t>& changed,
      const RowWriter& write_row);

  [[nodiscard]] const GridSpec& grid() const noexcept { return info_.grid; }

 private:
  void fill(const Eigen::Vector3i& block, const RowWriter& write_row, FieldBlock& out) const;
  /// The block to publish for what was written: the old one, a uniform one, or a copy.
  [[nodiscard]] std::shared_ptr<const FieldBlock> shared(
      const FieldBlock& written, const std::shared_ptr<const FieldBlock>& old);

  FieldInfo info_;
  const OccupancyView& view_;
  WorkerPool& workers_;
  DenseField::BlockTable blocks_;
  std::optional<std::int64_t> sequence_;  ///< Of the newest update.
  std::mutex uniform_mutex_;
  DenseField::BlockTable uniform_;  ///< Guarded by uniform_mutex_; a handful.
};

}  // namespace sidestep
