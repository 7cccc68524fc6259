#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
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
  /// differ from the call before. Returns which tiles' final values changed, as a mask (bit t:
  /// voxels t * kTile ... along x) for each y and each kTile slices, see changed_index().
  std::span<const std::uint64_t> update(const VoxelBits& obstacles,
                                        std::span<const std::uint8_t> row_changed);

  /// Where update()'s masks say what changed in row y of slice z.
  [[nodiscard]] static std::size_t changed_index(const Eigen::Vector3i& size_vox, int y,
                                                 int z) noexcept {
    const auto layers = static_cast<std::size_t>((size_vox.z() + kTile - 1) / kTile);
    return static_cast<std::size_t>(y) * layers + static_cast<std::size_t>(z / kTile);
  }

  /// Final values of a row, padded to whole tiles with 0.
  [[nodiscard]] const std::uint16_t* row(int y, int z) const noexcept { return along_z_.row(y, z); }

 private:
  using Grid = TiledGrid<std::uint16_t>;

  /// What a pass changed of a row.
  struct Change {
    std::uint64_t tiles = 0;                  ///< A mask.
    const std::uint16_t* previous = nullptr;  ///< Their values before, tile after tile.
  };
  struct ChangedRow {
    int row;
    Change change;
  };
  /// The rows along one axis at one place of the other.
  struct Line {
    int length;
    const std::uint16_t* in;  ///< The first row of what the pass before left.
    std::uint16_t* out;
    std::ptrdiff_t stride;  ///< From row to row.
  };
  /// What one thread needs.
  struct Workspace {
    Workspace(const Eigen::Vector3i& size, std::uint16_t cap);
    std::vector<std::uint16_t> row;
    EnvelopeLine envelope;
    // Of a line: what the pass before changed, and by row a mask of what this one changed.
    std::vector<ChangedRow> in;
    std::vector<std::uint64_t> out;
    // Values before, of the changed tiles: `in` refers to the first along y. The other goes tile by
    // tile from out_previous_begin on, each row after row.
    std::vector<std::uint16_t> in_previous, out_previous;
    std::array<std::size_t, 64> out_previous_begin;
    // Of one tile of a line.
    std::vector<int> rows;
    std::vector<std::uint16_t> tile_in_previous, tile_out_previous;
  };
  class BorrowedWorkspace;

  /// Calls task(i, workspace), on all threads, for those i in [0, count) that meet a condition.
  template <class Condition, class Task>
  void for_each(int count, const Condition& condition, const Task& task);
  /// Along x, then y, in a slice of which the rows `row_changed` may have changed.
  void update_slice(const VoxelBits& obstacles, std::span<const std::uint8_t> row_changed, int z,
                    Workspace& space);
  /// Along z.
  void update_line(int y, Workspace& space);
  /// Scans a row along x; adds what that changed to space.in.
  void pass_row(const VoxelBits& obstacles, int y, int z, Workspace& space);
  /// Brings the envelopes along a line up to date with space.in; fills space.out, and
  /// space.out_previous if that is wanted. The first update needs no values before.
  void pass_line(const Line& line, bool wants_previous, Workspace& space) const;
  /// Leaves what pass_line() changed in a slice for the lines along z.
  void hand_on(int z, Workspace& space);

  [[nodiscard]] std::size_t along_z_index(int y, int z) const noexcept {
    return static_cast<std::size_t>(z) +
           static_cast<std::size_t>(size_.z()) * static_cast<std::size_t>(y);
  }
  [[nodiscard]] std::size_t row_index(int y, int z) const noexcept {
    return static_cast<std::size_t>(y) +
           static_cast<std::size_t>(size_.y()) * static_cast<std::size_t>(z);
  }

  Eigen::Vector3i size_;
  std::uint16_t cap_;
  int reach_;  ///< Largest offset whose square is below the cap.
  int tiles_;
  WorkerPool& workers_;
  Grid along_x_, along_y_, along_z_;  ///< The values after each pass.
  // What the pass along y changed, for the one along z, which clears it.
  std::vector<Change> changes_;             ///< By along_z_index().
  std::vector<std::uint8_t> line_changed_;  ///< By y: whether there is any over all z.
  std::vector<std::vector<std::uint16_t>> along_y_previous_;  ///< By z.
  std::vector<std::uint64_t> changed_;                        ///< What update() returns.
  std::vector<int> busy_;                                     ///< Slices, or lines, to go through.
  std::mutex spaces_mutex_;
  std::vector<std::unique_ptr<Workspace>> spaces_;  ///< Those not in use.
  std::vector<std::uint16_t> start_tile_;  ///< What every tile holds before the first update.
  bool is_first_ = true;
};

}  // namespace sidestep::edt
