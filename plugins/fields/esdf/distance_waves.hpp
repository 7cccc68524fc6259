#pragma once

#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/core/worker_pool.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/tsdf_view.hpp>

namespace sidestep::esdf {

/// The 26 neighbours of voxels that are stored block by block: where they are found, and how far
/// away they lie. Blocks are kBlockSide_vox^3 voxels, x fastest, and follow each other in the
/// same order in a volume of `blocks`. Neighbours of the volume's outermost voxels do not exist.
class Neighbours {
 public:
  static constexpr int kCount = 26;

  Neighbours(const Eigen::Vector3i& blocks, double resolution_m);

  /// Index of a voxel's neighbours relative to its own, by direction.
  [[nodiscard]] const std::array<std::int32_t, kCount>& offsets(std::uint32_t voxel) const {
    return offsets_[place_[voxel % kVoxelsPerBlock]];
  }
  /// Metres to the neighbours: 1, sqrt(2) or sqrt(3) voxels.
  [[nodiscard]] const std::array<float, kCount>& steps_m() const noexcept { return steps_m_; }
  /// One of -1, 0 and 1 along each axis.
  [[nodiscard]] const Eigen::Vector3i& direction(int d) const noexcept {
    return directions_[static_cast<std::size_t>(d)];
  }
  [[nodiscard]] static int opposite(int d) noexcept { return kCount - 1 - d; }

 private:
  static constexpr std::uint32_t kVoxelsPerBlock = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox;
  static constexpr int kPlaces = 27;  ///< Low, middle or high end of a block along each axis.

  std::array<Eigen::Vector3i, kCount> directions_;
  std::array<float, kCount> steps_m_;
  std::array<std::array<std::int32_t, kCount>, kPlaces> offsets_;
  std::array<std::uint8_t, kVoxelsPerBlock> place_;
};

enum class Unknown : std::uint8_t { kFree, kOccupied, kIgnored };

struct WaveSettings {
  GridSpec grid;
  float max_distance_m = 0.0F;
  float band_m = 0.0F;        ///< Smaller distances are taken from the TSDF.
  float min_change_m = 0.0F;  ///< Smaller changes of those are left out.
  Unknown unknown = Unknown::kFree;
  bool full_euclidean = false;
};

/// Distances that spread from the voxels near surfaces to all others, kept up to date by a raise
/// wave, which takes back what changed voxels had given away, and a lower wave in order of
/// distance (Oleynikova et al. 2017, Sec. V; Lau et al. 2010).
///
/// Positive and negative voxels are two regions, each with its own waves, of distances without
/// sign. A voxel's value is the least that any neighbour offers: the neighbour's value plus the
/// step to it, or, from the other region, the step alone. In the quasi-Euclidean case that fixes
/// all values, whatever the order of the waves.
class DistanceWaves {
 public:
  DistanceWaves(const WaveSettings& settings, WorkerPool& workers);

  /// Whether a grid's voxels can be numbered, and offsets to where waves began be stored.
  [[nodiscard]] static bool fits(const GridSpec& grid, double max_distance_m);

  /// Takes over what changed in these blocks of the TSDF.
  void update(const TsdfView& tsdf, std::span<const std::int32_t> changed_blocks);

  /// Sets the flags of the blocks, in block_linear order, in which update() changed a distance.
  void flag_changed(std::vector<std::uint8_t>& flags) const;

  /// Signed distances of `count` voxels of row (y, z) from x on, all of one block.
  void row(int x, int y, int z, int count, float* distances_m) const;

 private:
  struct Free {
    void operator()(void* memory) const noexcept { std::free(memory); }
  };
  /// Zero where never written, and then without memory behind it.
  template <class Value>
  using LazyArray = std::unique_ptr<Value[], Free>;

  struct Offset {
    std::int16_t x = 0, y = 0, z = 0;
  };
  /// Voxels of one block that a change of the TSDF concerns.
  struct BlockChanges {
    std::vector<std::uint32_t> raised;   ///< May offer more than before: children lose them.
    std::vector<std::uint32_t> fixed;    ///< Offer a distance of their own.
    std::vector<std::uint32_t> orphans;  ///< Have none and need what neighbours offer.
    std::vector<std::uint32_t> flipped;  ///< Changed region.
    void clear();
  };

  [[nodiscard]] std::size_t stored_block(const Eigen::Vector3i& block) const noexcept;
  [[nodiscard]] std::uint32_t stored_voxel(int x, int y, int z) const noexcept;
  [[nodiscard]] Eigen::Vector3i block_at(std::int32_t block) const noexcept;
  void prepare_reach(std::span<const std::int32_t> blocks);
  void prepare(const Eigen::Vector3i& block);
  void scan(const TsdfBlock& tsdf, std::uint32_t first, BlockChanges& changes);
  void scan_voxel(std::uint32_t voxel, float tsdf_m, BlockChanges& changes);
  void raise(std::span<const BlockChanges> changes);
  /// Takes back what the voxels of raising_ gave, and what was given on.
  void raise_children();
  template <bool kFull>
  void spread(std::span<const BlockChanges> changes);
  template <bool kFull>
  void seed(std::span<const BlockChanges> changes);
  template <bool kFull>
  void adopt(std::uint32_t voxel);
  template <bool kFull>
  void lower();
  /// The distance that `from` offers to its neighbour in direction d, of the same region.
  template <bool kFull>
  [[nodiscard]] float offer(std::uint32_t from, int d) const noexcept;
  template <bool kFull>
  void accept(std::uint32_t voxel, float distance_m, int direction_to_parent, bool crosses);
  void push(std::uint32_t voxel);

  [[nodiscard]] bool takes_part(std::uint32_t voxel) const noexcept {
    return distance_m_[voxel] > 0.0F || (state_[voxel] & kFixed) != 0;
  }

  // The bits of a voxel's state. Its parent is the neighbour whose offer it took: 1 + direction.
  static constexpr std::uint8_t kParent = 0x1f;
  static constexpr std::uint8_t kNegative = 0x20;
  static constexpr std::uint8_t kFixed = 0x40;
  static constexpr std::uint8_t kQueued = 0x80;

  WaveSettings settings_;
  WorkerPool& workers_;
  Eigen::Vector3i counts_;         ///< Blocks of the grid.
  Eigen::Vector3i stored_counts_;  ///< With a rim of one block that stays zero.
  Neighbours neighbours_;
  LazyArray<float> distance_m_;  ///< Without sign. Zero and not fixed: takes no part.
  LazyArray<std::uint8_t> state_;
  LazyArray<Offset> offset_;  ///< Full Euclidean only: from where the wave began, in voxels.
  std::vector<std::uint8_t> prepared_, changed_;  ///< By stored block.
  std::vector<BlockChanges> changes_;
  std::vector<std::uint32_t> raising_, orphans_, adopting_;
  std::vector<std::vector<std::uint32_t>> buckets_;  ///< One for each voxel of distance.
};

}  // namespace sidestep::esdf
