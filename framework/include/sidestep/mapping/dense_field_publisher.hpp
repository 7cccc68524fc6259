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

/// The few blocks that hold one value throughout, of which one copy each is enough. [any]
template <class Block>
class UniformBlocks {
 public:
  /// The block to publish for what was written: `old` where it is equal, else a uniform block that
  /// is, else a copy.
  [[nodiscard]] std::shared_ptr<const Block> shared(const Block& written,
                                                    const std::shared_ptr<const Block>& old);

 private:
  std::mutex mutex_;
  std::vector<std::shared_ptr<const Block>> uniform_;  ///< Guarded by mutex_; a handful.
};

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

  /// Starts an update. Returns one flag a block, in block_linear order: all set before the first
  /// publication, else those of the update. A builder hands them back to publish(), with what it
  /// finds changed beyond them set, and without those in which it knows that no distance changed.
  /// Fails with kInvalidArgument where the update is not the next one, or names blocks that the
  /// grid does not have.
  [[nodiscard]] Result<std::vector<std::uint8_t>> begin(const MapUpdate& update);

  /// A snapshot in which the distances of the flagged blocks are rewritten, and what is known of
  /// the update's. Blocks that come out equal stay shared with the snapshot before.
  [[nodiscard]] std::shared_ptr<const DistanceField> publish(
      const MapUpdate& update, const std::vector<std::uint8_t>& changed,
      const RowWriter& write_row);

  [[nodiscard]] const GridSpec& grid() const noexcept { return info_.grid; }

 private:
  void write_distances(const Eigen::Vector3i& block, const RowWriter& write_row,
                       FieldBlock& out) const;
  void write_known(const Eigen::Vector3i& block, KnownBlock& out) const;

  FieldInfo info_;
  const OccupancyView& view_;
  WorkerPool& workers_;
  DenseField::Blocks blocks_;
  DenseField::KnownBlocks known_;
  std::optional<std::int64_t> sequence_;     ///< Of the newest update.
  std::vector<std::uint8_t> known_changed_;  ///< Blocks in which voxels may have become known.
  UniformBlocks<FieldBlock> uniform_distances_;
  UniformBlocks<KnownBlock> uniform_known_;
};

}  // namespace sidestep
