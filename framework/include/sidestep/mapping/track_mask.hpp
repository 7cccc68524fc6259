#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

class SeeThrough;

/// A word of a mask that has bits, or had some in the map before.
struct MaskedWord {
  std::size_t word;  ///< Its index, as VoxelBits have it.
  std::uint64_t before, now;
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
  /// Masks what is not settled inside a ball of the robot: it was left there by something that
  /// moves, and no ray gets there to free it.
  void claim_ball(const Eigen::Vector3d& centre_m, double radius_m);
  /// Ends a map, after all claims. What has been claimed in the last seconds, and is not now, stays
  /// in the mask once `frame`, that of the map, sees through it: rays have not freed it yet. It is
  /// an obstacle before, and again where a frame hits it.
  void end(const Frame& frame);

  /// As of end(), in no order; valid until the next begin(). All other words are 0, as they were in
  /// the map before.
  [[nodiscard]] std::span<const MaskedWord> mask() const noexcept { return mask_; }

 private:
  /// Cells have so many voxels along an edge. Rows that lie side by side, as many each way, make
  /// a beam wherever they have a word.
  static constexpr int kCell_vox = 4;
  using Beam = std::array<std::uint64_t, std::size_t{kCell_vox} * kCell_vox>;
  /// What has been claimed in a beam. A list of these is read in order: words of cylinders lie far
  /// apart.
  struct Trail {
    int word = 0, y = 0, z = 0;  ///< Where it begins: the word in its rows, and the first of these.
    Beam claimed{};              ///< In this map.
    /// Claimed since turned_stamp_, and in the time before it; occupied since.
    Beam recent{}, older{};
    Beam seen_free{};  ///< Of these, claimed no more, and seen through since.
    Beam mask{};
  };
  /// A word of a layer, and bits of it.
  struct LayerWord {
    int y, word;
    std::uint64_t bits;
  };
  void find_disc(const Track& track);
  [[nodiscard]] int layer_at(double z_m) const;
  /// Calls visit(y, word in the row, bits) for what belongs to the thing of disc_ in a layer.
  template <class Visit>
  void visit_layer(int z, Visit&& visit);
  /// Calls visit(which of a trail's words, its index in the map).
  template <class Visit>
  void visit_beam(const Trail& trail, Visit&& visit) const;
  void note_claim(int y, int z, int word, std::uint64_t bits);
  [[nodiscard]] std::size_t row(int y, int z) const noexcept {
    return (idx(y) + idx(grid_.size_vox.y()) * idx(z)) * idx(words_per_row_);
  }
  [[nodiscard]] std::size_t beam_of(int y, int z, int word) const noexcept {
    return row(y / kCell_vox, z / kCell_vox) + idx(word);
  }
  [[nodiscard]] int turns_of(const Frame& frame);
  void look_through(const SeeThrough& see_through, Trail& trail) const;

  double settle_s_;
  GridSpec grid_;
  int words_per_row_ = 0;
  VoxelBits occupied_;
  Stamp stamp_, snapshot_stamp_, turned_stamp_;
  std::vector<std::uint64_t> snapshot_;  ///< Occupied and not claimed, at snapshot_stamp_.
  std::vector<std::uint64_t> settled_, near_settled_;
  std::vector<char> may_hold_settled_;  ///< By beam: whether anything in near_settled_ is set.
  std::vector<Trail> trails_;
  std::vector<std::uint32_t> trail_of_;  ///< By beam: one more than its trail's index; 0: none.
  std::vector<MaskedWord> mask_;
  Stamp looked_stamp_;  ///< The frame of the map before, and where it was taken from.
  Eigen::Vector3d looked_from_m_ = Eigen::Vector3d::Zero();
  int turn_ = 0;
  // Scratch: for dilations; and of a thing, its circle and what a layer has there.
  std::vector<std::uint64_t> scratch_;
  std::vector<LayerWord> disc_, found_;
};

/// A map without the voxels of a mask. It offers an OccupancyView and no other: fields that are
/// attached to it do not see what the mask hides. What is known stays as it is. [mapping]
class SIDESTEP_EXPORT MaskedOccupancy final : public Mapper, public OccupancyView {
 public:
  /// Hides nothing at first. Both arguments are the same mapper, which must outlive this.
  MaskedOccupancy(Mapper& mapper, const OccupancyView& occupancy);

  /// Takes over the newest map, less the mask: after each integrate(), with its update, to which
  /// it adds the blocks in which only the mask changed. The mask has the layout of the map.
  void apply(std::span<const MaskedWord> mask, MapUpdate& update);

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
  std::vector<char> changed_;  ///< By block.
};

}  // namespace sidestep
