#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// A set of voxels, and the words that may hold any.
struct SparseVoxelBits {
  VoxelBits bits;
  std::span<const std::size_t> words;
};

/// The occupied voxels that belong to tracked things: those in a thing's cylinder that have not
/// been occupied for long, and those that it has left and that a frame has seen through since.
/// Voxels that were occupied before the thing came are settled, and stay out. Allocates only where
/// the grid changes, or where more is claimed than before. [mapping]
class SIDESTEP_EXPORT TrackMask {
 public:
  /// What is in the map of one thing.
  struct Extent {
    int voxels = 0;
    double bottom_m = 0.0, top_m = 0.0;  ///< Of its layers; meaningless where there are none.
  };

  /// A voxel is settled once it was occupied, and claimed for nothing, at two instants so far
  /// apart.
  explicit TrackMask(double settle_s) : settle_s_(settle_s) {}

  /// Begins a map. Where the grid has moved or the stamps went back, it starts over.
  void begin(const OccupancyView& map, Stamp stamp);
  [[nodiscard]] double resolution_m() const noexcept { return grid_.resolution_m; }
  /// Whether a voxel, or one of its 26 neighbours, is settled. False outside the grid.
  [[nodiscard]] bool is_settled_near(const Eigen::Vector3d& p_world) const noexcept;
  /// The same of occupied voxels.
  [[nodiscard]] bool is_occupied_near(const Eigen::Vector3d& p_world) const noexcept;
  /// How far from a thing's axis voxels may be its own: a voxel and a half beyond its radius.
  [[nodiscard]] double reach_m(const Track& track) const noexcept;
  /// Finds what belongs to a thing: voxels with centres in its reach, between its heights and in
  /// layers that continue these up and down. Masks it where `masks` says so.
  Extent claim(const Track& track, bool masks);
  /// Ends a map, after all claims. What has been claimed in the last seconds, and is not now, stays
  /// in the mask once `frame`, that of the map, sees through it: rays have not freed it yet. It is
  /// an obstacle before, and again where a frame hits it.
  void end(const Frame& frame);

  /// As of end(); valid until the next begin().
  [[nodiscard]] SparseVoxelBits mask() const noexcept {
    return {{mask_, words_per_row_}, touched_};
  }

 private:
  struct Disc;
  [[nodiscard]] Disc disc_of(const Track& track) const;
  [[nodiscard]] int layer_at(double z_m) const;
  /// Calls visit(word's index, bits) for what belongs to the thing in a layer.
  template <class Visit>
  void visit_layer(const Disc& disc, int z, Visit&& visit) const;
  [[nodiscard]] std::size_t row(int y, int z) const noexcept;

  double settle_s_;
  GridSpec grid_;
  int words_per_row_ = 0;
  VoxelBits occupied_;
  Stamp stamp_, snapshot_stamp_, turned_stamp_;
  std::vector<std::uint64_t> snapshot_;  ///< Occupied and not claimed, at snapshot_stamp_.
  std::vector<std::uint64_t> settled_, near_settled_;
  std::vector<std::uint64_t> claimed_;  ///< In this map.
  /// Claimed since turned_stamp_, and in the time before it.
  std::vector<std::uint64_t> recent_, older_;
  std::vector<std::uint64_t> seen_free_;  ///< Of these, claimed no more, and seen through since.
  std::vector<std::uint64_t> mask_;
  std::vector<std::size_t> touched_;  ///< Words in which one of these has bits.
  // Scratch: what a frame sees of cells of voxels, and those that were asked for.
  std::vector<char> cells_;
  std::vector<char*> judged_;
  std::vector<std::uint64_t> scratch_;
};

/// A map without the voxels of a mask. It offers an OccupancyView and no other: fields that are
/// attached to it do not see what the mask hides. What is known stays as it is. [mapping]
class SIDESTEP_EXPORT MaskedOccupancy final : public Mapper, public OccupancyView {
 public:
  /// Hides nothing at first. Both arguments are the same mapper, which must outlive this.
  MaskedOccupancy(Mapper& mapper, const OccupancyView& occupancy);

  /// Takes over the newest map, less the mask: after each integrate(), with its update, to which
  /// it adds the blocks in which only the mask changed. The mask has the layout of the map.
  void apply(const SparseVoxelBits& mask, MapUpdate& update);

  /// That of the mapper; apply() must follow.
  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override {
    return mapper_.integrate(frame);
  }
  [[nodiscard]] const GridSpec& grid() const noexcept override { return mapper_.grid(); }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return mapper_.grid(); }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return occupancy_.known(); }

 private:
  Mapper& mapper_;
  const OccupancyView& occupancy_;
  int words_per_row_;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::size_t> masked_words_;  ///< Those of the mask as it was.
};

}  // namespace sidestep
