#include <sidestep/mapping/track_mask.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <utility>

#include <sidestep/core/index.hpp>
#include "dilation.hpp"
#include "surface_points.hpp"

namespace sidestep {
namespace {

/// What a thing has left may stay in the mask for at least so long. Rays that see through it free
/// it in 0.4 s at 10 Hz.
constexpr double kTrail_s = 2.0;
/// A thing ends where so many layers in a row hold fewer claimed voxels than kLeastInLayer.
constexpr int kGap_vox = 2;
constexpr int kLeastInLayer = 2;
/// Nothing tracked is higher.
constexpr double kTallest_m = 2.2;
/// A cylinder is widened by this: surfaces are mapped up to half a voxel's diagonal outside it.
constexpr double kMargin_vox = 1.5;
/// Cells of so many voxels along an edge, and how many rays are looked at across them: one every
/// voxel at most.
constexpr int kCell_vox = 4, kRaysOfCell = 5, kRaysOfVoxel = 2;
constexpr char kUnseen = -1;
/// Heights at a layer's edge are rounded.
constexpr double kAtEdge_m = 1e-6;

/// Bits [first, last] of a word, of which `first` may be negative and `last` beyond its end.
std::uint64_t bits_between(int first, int last) {
  if (last < 0 || first > 63) return 0;
  const std::uint64_t from = ~std::uint64_t{0} << std::max(first, 0);
  return last >= 63 ? from : from & ((std::uint64_t{2} << last) - 1);
}

}  // namespace

/// A circle's voxels, row by row.
struct TrackMask::Disc {
  struct Row {
    int y, first_x, last_x;
  };
  std::vector<Row> rows;
};

double TrackMask::reach_m(const Track& track) const noexcept {
  return track.radius_m + kMargin_vox * grid_.resolution_m;
}

std::size_t TrackMask::row(int y, int z) const noexcept {
  return (idx(y) + idx(grid_.size_vox.y()) * idx(z)) * idx(words_per_row_);
}

void TrackMask::begin(const OccupancyView& map, Stamp stamp) {
  occupied_ = map.occupied();
  if (grid_ != map.occupancy_grid() || stamp < stamp_ || mask_.empty()) {
    grid_ = map.occupancy_grid();
    words_per_row_ = occupied_.words_per_row;
    snapshot_.assign(occupied_.words.begin(), occupied_.words.end());
    for (auto* bits :
         {&settled_, &near_settled_, &claimed_, &recent_, &older_, &seen_free_, &mask_}) {
      bits->assign(occupied_.words.size(), 0);
    }
    touched_.clear();
    cells_.clear();
    snapshot_stamp_ = turned_stamp_ = stamp;
  }
  stamp_ = stamp;
  if (stamp.seconds() - snapshot_stamp_.seconds() >= settle_s_) {
    for (std::size_t w = 0; w < mask_.size(); ++w) {
      const std::uint64_t now = occupied_.words[w] & ~(recent_[w] | older_[w]);
      settled_[w] = snapshot_[w] & now;
      snapshot_[w] = now;
    }
    dilate({settled_, words_per_row_}, grid_, scratch_, near_settled_);
    snapshot_stamp_ = stamp;
  }
  if (stamp.seconds() - turned_stamp_.seconds() < kTrail_s) return;
  for (const std::size_t at : touched_) older_[at] = std::exchange(recent_[at], 0);
  turned_stamp_ = stamp;
}

bool TrackMask::is_settled_near(const Eigen::Vector3d& p_world) const noexcept {
  const Eigen::Vector3i voxel = grid_.voxel_at(p_world);
  return grid_.contains(voxel) && VoxelBits{near_settled_, words_per_row_}.at(grid_, voxel);
}

bool TrackMask::is_occupied_near(const Eigen::Vector3d& p_world) const noexcept {
  const Eigen::Vector3i voxel = grid_.voxel_at(p_world);
  if (!grid_.contains(voxel)) return false;
  const int last_x = grid_.size_vox.x() - 1;
  const int first_word = std::max(voxel.x() - 1, 0) / 64;
  const int last_word = std::min(voxel.x() + 1, last_x) / 64;
  for (int z = std::max(voxel.z() - 1, 0); z <= std::min(voxel.z() + 1, grid_.size_vox.z() - 1);
       ++z) {
    for (int y = std::max(voxel.y() - 1, 0); y <= std::min(voxel.y() + 1, grid_.size_vox.y() - 1);
         ++y) {
      for (int word = first_word; word <= last_word; ++word) {
        const int x = voxel.x() - 64 * word;
        if ((occupied_.words[row(y, z) + idx(word)] & bits_between(x - 1, x + 1)) != 0) return true;
      }
    }
  }
  return false;
}

/// The voxels whose centres lie in a thing's circle, widened by a voxel and a half.
TrackMask::Disc TrackMask::disc_of(const Track& track) const {
  const Eigen::Vector2d centre = (track.position_m - grid_.origin_m.head<2>()) / grid_.resolution_m;
  const double radius_vox = reach_m(track) / grid_.resolution_m;
  // Rounded to voxels; a thing far outside the grid has none in it.
  const auto first = [](double low, int size) {
    return static_cast<int>(std::clamp(std::ceil(low - 0.5), 0.0, static_cast<double>(size)));
  };
  const auto last = [](double high, int size) {
    return static_cast<int>(std::clamp(std::floor(high - 0.5), -1.0, size - 1.0));
  };
  Disc disc;
  const int last_y = last(centre.y() + radius_vox, grid_.size_vox.y());
  for (int y = first(centre.y() - radius_vox, grid_.size_vox.y()); y <= last_y; ++y) {
    const double beside_vox = y + 0.5 - centre.y();
    const double half_vox =
        std::sqrt(std::max(0.0, radius_vox * radius_vox - beside_vox * beside_vox));
    disc.rows.push_back({y, first(centre.x() - half_vox, grid_.size_vox.x()),
                         last(centre.x() + half_vox, grid_.size_vox.x())});
  }
  return disc;
}

int TrackMask::layer_at(double z_m) const {
  const double z = std::floor((z_m - grid_.origin_m.z()) / grid_.resolution_m);
  return static_cast<int>(std::clamp(z, 0.0, grid_.size_vox.z() - 1.0));
}

template <class Visit>
void TrackMask::visit_layer(const Disc& disc, int z, Visit&& visit) const {
  for (const auto& [y, first_x, last_x] : disc.rows) {
    for (int word = first_x / 64; 64 * word <= last_x; ++word) {
      const std::size_t at = row(y, z) + idx(word);
      const std::uint64_t its = occupied_.words[at] & ~settled_[at] &
                                bits_between(first_x - 64 * word, last_x - 64 * word);
      if (its != 0) visit(at, its);
    }
  }
}

TrackMask::Extent TrackMask::claim(const Track& track, bool masks) {
  const Disc disc = disc_of(track);
  const int bottom = layer_at(track.bottom_m);
  const int top = std::max(bottom, layer_at(track.top_m - kAtEdge_m));
  int voxels = 0, lowest = grid_.size_vox.z(), highest = -1;
  const auto voxels_in = [&](int z) {
    int count = 0;
    visit_layer(disc, z, [&](std::size_t, std::uint64_t its) { count += std::popcount(its); });
    return count;
  };
  const auto take = [&](int z) {
    int count = 0;
    visit_layer(disc, z, [&](std::size_t at, std::uint64_t its) {
      count += std::popcount(its);
      if (!masks) return;
      if ((claimed_[at] | recent_[at] | older_[at]) == 0) touched_.push_back(at);
      claimed_[at] |= its;
      recent_[at] |= its;
    });
    voxels += count;
    if (count < kLeastInLayer) return;
    lowest = std::min(lowest, z);
    highest = std::max(highest, z);
  };
  for (int z = bottom; z <= top; ++z) take(z);
  // Layers that continue these, up to a gap.
  const int tallest = static_cast<int>(kTallest_m / grid_.resolution_m);
  const auto continue_to = [&](int first, int last, int step) {
    for (int z = first, begin = first; z != last + step && std::abs(z - begin) <= kGap_vox;
         z += step) {
      if (voxels_in(z) < kLeastInLayer) continue;
      for (; begin != z + step; begin += step) take(begin);
    }
  };
  continue_to(top + 1, std::max(top, std::min(grid_.size_vox.z(), bottom + tallest) - 1), 1);
  continue_to(bottom - 1, std::min(bottom, std::max(0, top - tallest + 1)), -1);
  if (highest < 0) return {};
  return {voxels, grid_.origin_m.z() + lowest * grid_.resolution_m,
          grid_.origin_m.z() + (highest + 1) * grid_.resolution_m};
}

void TrackMask::end(const Frame& frame) {
  // Cells first: a thing leaves tens of thousands of voxels of 2.5 cm, most of them in cells that
  // are all seen through or all hidden.
  const SeeThrough see_through(frame);
  const Eigen::Vector3i cells = (grid_.size_vox.array() + kCell_vox - 1) / kCell_vox;
  cells_.resize(idx(cells.prod()), kUnseen);
  judged_.clear();
  const auto cell_answer = [&](const Eigen::Vector3i& cell) {
    char& answer = cells_[idx(cell.x() + cells.x() * (cell.y() + cells.y() * cell.z()))];
    if (answer != kUnseen) return answer;
    const Eigen::Vector3d centre_m =
        grid_.origin_m +
        kCell_vox * grid_.resolution_m * (cell.cast<double>().array() + 0.5).matrix();
    answer = static_cast<char>(see_through(centre_m, kCell_vox * grid_.resolution_m, kRaysOfCell));
    judged_.push_back(&answer);
    return answer;
  };
  const std::size_t rows = idx(words_per_row_), slice = idx(grid_.size_vox.y());
  std::size_t kept = 0;
  for (const std::size_t at : touched_) {
    // What has been freed is no trail any more.
    const std::uint64_t occupied = occupied_.words[at];
    recent_[at] &= occupied;
    older_[at] &= occupied;
    const std::uint64_t all = recent_[at] | older_[at];
    const std::uint64_t claimed = std::exchange(claimed_[at], 0), left = all & ~claimed;
    std::uint64_t& seen_free = seen_free_[at];
    seen_free &= left;
    mask_[at] = claimed | seen_free;
    if (all != 0) touched_[kept++] = at;
    if (left == 0) continue;
    const Eigen::Vector3i first(static_cast<int>(at % rows) * 64,
                                static_cast<int>(at / rows % slice),
                                static_cast<int>(at / rows / slice));
    for (int x = 0; x < 64; x += kCell_vox) {
      std::uint64_t part = left & bits_between(x, x + kCell_vox - 1);
      if (part == 0) continue;
      const char answer = cell_answer((first + Eigen::Vector3i(x, 0, 0)) / kCell_vox);
      if (answer == static_cast<char>(SeeThrough::Answer::kYes)) seen_free |= part;
      if (answer != static_cast<char>(SeeThrough::Answer::kPartly)) continue;
      for (; part != 0; part &= part - 1) {
        const Eigen::Vector3i voxel = first + Eigen::Vector3i(std::countr_zero(part), 0, 0);
        const auto its = see_through(grid_.centre_m(voxel), grid_.resolution_m, kRaysOfVoxel);
        const std::uint64_t bit = part & (~part + 1);
        if (its == SeeThrough::Answer::kYes) seen_free |= bit;
        if (its == SeeThrough::Answer::kPartly) seen_free &= ~bit;
      }
    }
    mask_[at] = claimed | seen_free;
  }
  touched_.resize(kept);
  for (char* answer : judged_) *answer = kUnseen;
}

MaskedOccupancy::MaskedOccupancy(Mapper& mapper, const OccupancyView& occupancy)
    : mapper_(mapper),
      occupancy_(occupancy),
      words_per_row_(occupancy.occupied().words_per_row),
      occupied_(occupancy.occupied().words.begin(), occupancy.occupied().words.end()) {}

void MaskedOccupancy::apply(const SparseVoxelBits& mask, MapUpdate& update) {
  constexpr int kBlocksPerWord = 64 / kBlockSide_vox;
  const GridSpec& grid = mapper_.grid();
  const Eigen::Vector3i counts = block_counts(grid);
  const std::span<const std::uint64_t> full = occupancy_.occupied().words;
  const std::size_t rows = idx(words_per_row_), slice = idx(grid.size_vox.y());
  const std::size_t map_blocks = update.changed_blocks.size();
  // Words that were masked, or are: their blocks may be others than those that the map changed.
  const auto follow_mask = [&](const std::vector<std::size_t>& words) {
    for (const std::size_t w : words) {
      const std::uint64_t left = full[w] & ~mask.bits.words[w];
      const std::uint64_t differs = std::exchange(occupied_[w], left) ^ left;
      for (int part = 0; differs != 0 && part < kBlocksPerWord; ++part) {
        const int first = part * kBlockSide_vox;
        if ((differs & bits_between(first, first + kBlockSide_vox - 1)) == 0) continue;
        const Eigen::Vector3i block(static_cast<int>(w % rows) * kBlocksPerWord + part,
                                    static_cast<int>(w / rows % slice) / kBlockSide_vox,
                                    static_cast<int>(w / rows / slice) / kBlockSide_vox);
        update.changed_blocks.push_back(block_linear(block, counts));
      }
    }
  };
  follow_mask(masked_words_);
  masked_words_.assign(mask.words.begin(), mask.words.end());
  follow_mask(masked_words_);
  // The map's own changes. Blocks side by side share words.
  std::int64_t column_before = -1;
  for (std::size_t i = 0; i < map_blocks; ++i) {
    const std::int32_t linear = update.changed_blocks[i];
    const int word = linear % counts.x() / kBlocksPerWord, row = linear / counts.x();
    const std::int64_t column = std::int64_t{row} * words_per_row_ + word;
    if (std::exchange(column_before, column) == column) continue;
    const Eigen::Vector2i first =
        kBlockSide_vox * Eigen::Vector2i(row % counts.y(), row / counts.y());
    const Eigen::Vector2i last =
        (first.array() + kBlockSide_vox).min(grid.size_vox.tail<2>().array());
    for (int z = first.y(); z < last.y(); ++z) {
      for (int y = first.x(); y < last.x(); ++y) {
        const std::size_t w = (idx(y) + slice * idx(z)) * rows + idx(word);
        occupied_[w] = full[w] & ~mask.bits.words[w];
      }
    }
  }
  std::ranges::sort(update.changed_blocks);
  const auto repeated = std::ranges::unique(update.changed_blocks);
  update.changed_blocks.erase(repeated.begin(), repeated.end());
}

}  // namespace sidestep
