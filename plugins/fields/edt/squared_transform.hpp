#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

namespace sidestep::edt {

/// Squared distances in voxels are computed in tiles of this many voxels along x.
inline constexpr int kTile = 64;

/// The exact squared Euclidean distance, in voxels, of every voxel of a grid to the nearest
/// obstacle, kept up to date as obstacles change.
///
/// Three passes, as Felzenszwalb and Huttenlocher (2012): along x a scan of the occupancy bits,
/// along y and z the lower envelope min over d of g(. + d) + d^2. Each output tile of a pass
/// depends on a window of the pass before only, so what did not change there is not computed
/// again; the result is that of a full transform, bit for bit.
///
/// Value: std::uint16_t where cap <= 32767, else std::uint32_t.
template <class Value>
class SquaredTransform {
 public:
  /// Before the first update every voxel is an obstacle, or none is: the nearer this is to the
  /// truth, the less there is to compute.
  enum class Start { kNoObstacles, kAllObstacles };

  /// Squared distances are cut off at `cap` >= 1. `workers` outlives the transform.
  SquaredTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap, Start start,
                   WorkerPool& workers);

  /// Takes over rows of obstacles: `row_changed[y + ny * z]` says which rows of `obstacles` may
  /// differ from the call before. Returns for each row the mask of tiles whose final values
  /// changed (bit t: voxels t * kTile ... of the row).
  std::span<const std::uint64_t> update(const VoxelBits& obstacles,
                                        std::span<const std::uint8_t> row_changed);

  /// Final values of a row, padded to whole tiles with 0.
  [[nodiscard]] const Value* row(int y, int z) const noexcept {
    return final_.data() + offset_of(y, z);
  }
  /// False where the tile of voxel (x, y, z) is at the cap throughout.
  [[nodiscard]] bool holds_below_cap(int x, int y, int z) const noexcept {
    return ((pass_z_.filled[row_index(y, z)] >> (x / kTile)) & 1u) != 0;
  }

 private:
  [[nodiscard]] std::size_t row_index(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(z);
  }
  /// How many voxels of a tile are in the grid.
  [[nodiscard]] int lanes_of(int tile) const noexcept {
    return std::min(kTile, size_.x() - tile * kTile);
  }
  /// One of the grids with, for each row, which tiles changed and which hold a value < cap.
  struct Pass {
    std::vector<std::uint64_t> changed;
    std::vector<std::uint64_t> filled;
  };

  /// Of the first voxel of a row in each of the grids.
  [[nodiscard]] std::size_t offset_of(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(pitch_) +
           static_cast<std::size_t>(z) * slice_pitch_;
  }
  /// Writes a tile of a pass over the old one, if they differ.
  void store(const Value* fresh, Value* old, std::size_t row, int tile, Pass& pass) const;
  void scan_rows(const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed);
  /// The rows along one axis: their number, and what leads from one to the next among the rows
  /// and in memory.
  struct Line {
    int length;
    std::size_t row_step;
    std::size_t step;
  };
  /// Lower envelopes from `in` to `out` along the line from row (y, z) on.
  void envelope(int y, int z, const Line& line, const std::vector<Value>& in, const Pass& in_pass,
                std::vector<Value>& out, Pass& out_pass) const;

  Eigen::Vector3i size_;
  Value cap_;
  int reach_;  ///< Largest offset whose square is below the cap.
  int tiles_;
  int pitch_;                ///< From row to row, in values.
  std::size_t slice_pitch_;  ///< From slice to slice of constant z, in values.
  WorkerPool& workers_;
  std::vector<Value> along_x_, along_y_, final_;
  Pass pass_x_, pass_y_, pass_z_;
};

extern template class SquaredTransform<std::uint16_t>;
extern template class SquaredTransform<std::uint32_t>;

}  // namespace sidestep::edt
