#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/mapping/occupancy_view.hpp>

#include "envelope_line.hpp"
#include "tiled_grid.hpp"

namespace sidestep::edt {

/// The exact squared Euclidean distance, in voxels, of every voxel of a grid to the nearest
/// obstacle, cut off at a cap and kept up to date as obstacles change.
///
/// Three passes, as Felzenszwalb and Huttenlocher (2012): along x a scan of the occupancy bits,
/// along y and z the lower envelope min over d of g(. + d) + d^2. A pass hands on the tiles whose
/// values it changed, with their values before. Where few rows of a line changed, each spreads its
/// change to the rows that it can reach: a smaller value lowers theirs, and only where a larger one
/// was the minimum is that row's envelope computed again. The result is that of a full transform,
/// bit for bit, for both are the exact minimum.
class IncrementalTransform {
 public:
  /// The largest cap: values and the sum of any two fit 16 bits.
  static constexpr std::uint32_t kLargestCap = 32767;

  /// Before the first update every voxel is an obstacle, or none is: the nearer this is to the
  /// truth, the less there is to compute.
  enum class Start { kNoObstacles, kAllObstacles };

  /// Squared distances are cut off at `cap` in [1, kLargestCap]. `workers` outlives the transform.
  IncrementalTransform(const Eigen::Vector3i& size_vox, std::uint32_t cap, Start start,
                       WorkerPool& workers);

  /// Takes over rows of obstacles: `row_changed[y + ny * z]` says which rows of `obstacles` may
  /// differ from the call before. Returns for each row the mask of tiles whose final values
  /// changed (bit t: voxels t * kTile ... of the row).
  std::span<const std::uint64_t> update(const VoxelBits& obstacles,
                                        std::span<const std::uint8_t> row_changed);

  /// Final values of a row, padded to whole tiles with 0.
  [[nodiscard]] const std::uint16_t* row(int y, int z) const noexcept {
    return along_z_.values.row(y, z);
  }

 private:
  using Grid = TiledGrid<std::uint16_t>;

  /// The values after a pass, and what the update changed of them.
  struct Pass {
    Grid values;
    std::vector<std::uint64_t> changed;  ///< A mask of tiles for each row.
  };
  /// The rows along one axis at one place of the other.
  struct Line {
    int length;
    int y, z;               ///< Of its first row.
    std::size_t first_row;  ///< As an index into masks.
    std::size_t row_step;
    std::ptrdiff_t stride;  ///< From row to row, in values.
  };
  /// What one thread needs.
  struct Workspace {
    Workspace(const Eigen::Vector3i& size, std::uint16_t cap);
    std::vector<std::uint16_t> row;
    EnvelopeLine envelope;
    std::vector<int> changed;            ///< Rows of a line.
    std::vector<std::uint16_t> out_was;  ///< Where there is no grid for it, one tile a row.
  };

  void pass_row(const VoxelBits& obstacles, int y, int z, Workspace& space);
  /// Envelopes along a line, from `in` to `out`; what `out` held before goes to `out_was`. The last
  /// pass has none, and the first update needs neither. Whether any of `out` changed.
  bool pass_line(const Line& line, const Pass& in, const Grid* in_was, Pass& out, Grid* out_was,
                 Workspace& space) const;

  /// Fills line_tiles_.
  void find_changed_lines();

  [[nodiscard]] std::size_t row_index(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(z);
  }

  Eigen::Vector3i size_;
  std::uint16_t cap_;
  int reach_;  ///< Largest offset whose square is below the cap.
  int tiles_;
  WorkerPool& workers_;
  Pass along_x_, along_y_, along_z_;
  Grid along_x_was_, along_y_was_;  ///< Of tiles that the update changed, the values before it.
  // What the newest update changed: of slices along y, of lines along z. Where nothing changed in
  // two updates on end there is nothing to compute, nor a mask to clear.
  std::vector<std::uint8_t> slice_changed_, line_changed_;
  std::vector<std::uint64_t> line_tiles_;  ///< By y: tiles that changed along y, over all z.
  std::vector<std::uint16_t> start_tile_;  ///< What every tile holds before the first update.
  bool is_first_ = true;
};

}  // namespace sidestep::edt
