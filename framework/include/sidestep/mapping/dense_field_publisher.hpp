#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/field/dense_field.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep {

/// Publishes dense fields block by block: what a FieldBuilder needs to hand out snapshots that
/// share whatever did not change. [mapping]
class DenseFieldPublisher {
 public:
  /// Writes the distances of `count` voxels of row (y, z) from x on. Called from the worker
  /// pool, for different rows at once.
  using RowWriter = std::function<void(int x, int y, int z, int count, float* distances_m)>;

  /// `view` says which voxels are known; it and `workers` outlive the publisher. `info` has
  /// everything but sequence and stamp.
  DenseFieldPublisher(FieldInfo info, const OccupancyView& view, WorkerPool& workers);

  /// One flag a block, in block_linear order; all set before the first publication, else those
  /// of the update. What the builder finds changed beyond them it sets as well.
  [[nodiscard]] std::vector<std::uint8_t> changed_blocks(const MapUpdate& update) const;

  /// A snapshot in which the flagged blocks are written anew. Blocks that come out equal stay
  /// shared with the snapshot before.
  [[nodiscard]] std::shared_ptr<const DistanceField> publish(
      const MapUpdate& update, const std::vector<std::uint8_t>& changed,
      const RowWriter& write_row);

  [[nodiscard]] const GridSpec& grid() const noexcept { return info_.grid; }

 private:
  void fill(const Eigen::Vector3i& block, const RowWriter& write_row, FieldBlock& out) const;

  FieldInfo info_;
  const OccupancyView& view_;
  WorkerPool& workers_;
  DenseField::BlockTable blocks_;
};

}  // namespace sidestep
