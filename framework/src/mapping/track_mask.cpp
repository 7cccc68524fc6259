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
/// How many rays are looked at across a cell: one every voxel at most.
constexpr int kRaysOfCell = 5, kRaysOfVoxel = 2;
/// A trail is looked at so often, by a camera's frames that come faster in turns.
constexpr double kLook_s = 0.1;
constexpr int kMostTurns = 4;
/// Heights at a layer's edge are rounded.
constexpr double kAtEdge_m = 1e-6;

/// Bits [first, last] of a word, of which `first` may be negative and `last` beyond its end.
std::uint64_t bits_between(int first, int last) {
  if (last < 0 || first > 63) return 0;
  const std::uint64_t from = ~std::uint64_t{0} << std::max(first, 0);
  return last >= 63 ? from : from & ((std::uint64_t{2} << last) - 1);
}

}  // namespace

double TrackMask::reach_m(const Track& track) const noexcept {
  return track.radius_m + kMargin_vox * grid_.resolution_m;
}

template <class Visit>
void TrackMask::visit_beam(const Trail& trail, Visit&& visit) const {
  const int rows = std::min(kCell_vox, grid_.size_vox.y() - trail.y);
  const int layers = std::min(kCell_vox, grid_.size_vox.z() - trail.z);
  for (int z = 0; z < layers; ++z) {
    std::size_t at = row(trail.y, trail.z + z) + idx(trail.word);
    for (int y = 0; y < rows; ++y, at += idx(words_per_row_)) visit(idx(kCell_vox * z + y), at);
  }
}

void TrackMask::begin(const OccupancyView& map, Stamp stamp) {
  occupied_ = map.occupied();
  const bool is_same_grid = grid_ == map.occupancy_grid() && !snapshot_.empty();
  if (!is_same_grid || stamp < stamp_) {
    grid_ = map.occupancy_grid();
    words_per_row_ = occupied_.words_per_row;
    snapshot_.assign(occupied_.words.begin(), occupied_.words.end());
    settled_.assign(snapshot_.size(), 0);
    near_settled_.assign(snapshot_.size(), 0);
    may_hold_settled_.assign(row(0, grid_.size_vox.z() / kCell_vox + 1), 0);
    if (!is_same_grid) trails_.clear();
    // What was masked is not any more.
    for (Trail& trail : trails_) trail.recent = trail.older = trail.seen_free = {};
    trail_of_.resize(may_hold_settled_.size());
    if (!is_same_grid) std::ranges::fill(trail_of_, 0);
    snapshot_stamp_ = turned_stamp_ = stamp;
  }
  stamp_ = stamp;
  // What has been freed is no trail any more. Claims, which are not in the list's order, find it in
  // the cache then.
  for (Trail& trail : trails_) {
    trail.claimed = {};  // of a map that was never ended
    visit_beam(trail, [&](std::size_t i, std::size_t at) {
      trail.recent[i] &= occupied_.words[at];
      trail.older[i] &= occupied_.words[at];
    });
  }
  if (stamp.seconds() - snapshot_stamp_.seconds() >= settle_s_) {
    for (std::size_t w = 0; w < snapshot_.size(); ++w) {
      settled_[w] = snapshot_[w] & occupied_.words[w];
      snapshot_[w] = occupied_.words[w];
    }
    for (const Trail& trail : trails_) {
      visit_beam(trail, [&](std::size_t i, std::size_t at) {
        settled_[at] &= ~(trail.recent[i] | trail.older[i]);
        snapshot_[at] &= ~(trail.recent[i] | trail.older[i]);
      });
    }
    dilate({settled_, words_per_row_}, grid_, scratch_, near_settled_);
    std::ranges::fill(may_hold_settled_, 0);
    std::size_t w = 0;
    for (int z = 0; z < grid_.size_vox.z(); ++z) {
      for (int y = 0; y < grid_.size_vox.y(); ++y) {
        for (int word = 0; word < words_per_row_; ++word, ++w) {
          if (near_settled_[w] != 0) may_hold_settled_[beam_of(y, z, word)] = 1;
        }
      }
    }
    snapshot_stamp_ = stamp;
  }
  if (stamp.seconds() - turned_stamp_.seconds() < kTrail_s) return;
  for (Trail& trail : trails_) trail.older = std::exchange(trail.recent, {});
  turned_stamp_ = stamp;
}

void TrackMask::note_claim(int y, int z, int word, std::uint64_t bits) {
  std::uint32_t& which = trail_of_[beam_of(y, z, word)];
  if (which == 0) {
    trails_.push_back({.word = word, .y = y - y % kCell_vox, .z = z - z % kCell_vox});
    which = static_cast<std::uint32_t>(trails_.size());
  }
  trails_[which - 1].claimed[idx(kCell_vox * (z % kCell_vox) + y % kCell_vox)] |= bits;
}

bool TrackMask::is_settled_near(const Eigen::Vector3d& p_world) const noexcept {
  const Eigen::Vector3i voxel = grid_.voxel_at(p_world);
  return grid_.contains(voxel) &&
         may_hold_settled_[beam_of(voxel.y(), voxel.z(), voxel.x() / 64)] != 0 &&
         VoxelBits{near_settled_, words_per_row_}.at(grid_, voxel);
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

/// Finds the voxels whose centres lie in a thing's circle, widened by a voxel and a half.
void TrackMask::find_disc(const Track& track) {
  const Eigen::Vector2d centre = (track.position_m - grid_.origin_m.head<2>()) / grid_.resolution_m;
  const double radius_vox = reach_m(track) / grid_.resolution_m;
  // Rounded to voxels; a thing far outside the grid has none in it.
  const auto first = [](double low, int size) {
    return static_cast<int>(std::clamp(std::ceil(low - 0.5), 0.0, static_cast<double>(size)));
  };
  const auto last = [](double high, int size) {
    return static_cast<int>(std::clamp(std::floor(high - 0.5), -1.0, size - 1.0));
  };
  disc_.clear();
  const int last_y = last(centre.y() + radius_vox, grid_.size_vox.y());
  for (int y = first(centre.y() - radius_vox, grid_.size_vox.y()); y <= last_y; ++y) {
    const double beside_vox = y + 0.5 - centre.y();
    const double half_vox =
        std::sqrt(std::max(0.0, radius_vox * radius_vox - beside_vox * beside_vox));
    const int first_x = first(centre.x() - half_vox, grid_.size_vox.x());
    const int last_x = last(centre.x() + half_vox, grid_.size_vox.x());
    for (int word = first_x / 64; 64 * word <= last_x; ++word) {
      disc_.push_back({y, word, bits_between(first_x - 64 * word, last_x - 64 * word)});
    }
  }
  found_.resize(disc_.size());
}

int TrackMask::layer_at(double z_m) const {
  const double z = std::floor((z_m - grid_.origin_m.z()) / grid_.resolution_m);
  return static_cast<int>(std::clamp(z, 0.0, grid_.size_vox.z() - 1.0));
}

template <class Visit>
void TrackMask::visit_layer(int z, Visit&& visit) {
  const std::size_t ahead = row(0, z < grid_.size_vox.z() - 2 ? 2 : 0);
  // Most words hold nothing; which ones, no branch predicts.
  std::size_t count = 0;
  for (const LayerWord& word : disc_) {
    const std::uint64_t* const its = occupied_.words.data() + row(word.y, z) + word.word;
    // Layers lie far apart in memory: that after the next is on its way meanwhile.
    __builtin_prefetch(its + ahead);
    found_[count] = {word.y, word.word, *its & word.bits};
    count += found_[count].bits != 0 ? 1 : 0;
  }
  for (const auto& [y, word, bits] : std::span(found_).first(count)) {
    std::uint64_t its = bits;
    // Where nothing is settled, it need not be read.
    if (may_hold_settled_[beam_of(y, z, word)] != 0) its &= ~settled_[row(y, z) + idx(word)];
    if (its != 0) visit(y, word, its);
  }
}

void TrackMask::claim_ball(const Eigen::Vector3d& centre_m, double radius_m) {
  Track track;
  track.position_m = centre_m.head<2>();
  const int first_z = layer_at(centre_m.z() - radius_m), last_z = layer_at(centre_m.z() + radius_m);
  for (int z = first_z; z <= last_z; ++z) {
    const double above_m = grid_.origin_m.z() + (z + 0.5) * grid_.resolution_m - centre_m.z();
    if (std::abs(above_m) >= radius_m) continue;
    const double across_m = std::sqrt(radius_m * radius_m - above_m * above_m);
    // find_disc() widens what is tracked.
    track.radius_m = across_m - kMargin_vox * grid_.resolution_m;
    find_disc(track);
    visit_layer(z, [&](int y, int word, std::uint64_t its) { note_claim(y, z, word, its); });
  }
}

TrackMask::Extent TrackMask::claim(const Track& track, bool masks) {
  find_disc(track);
  const int bottom = layer_at(track.bottom_m);
  const int top = std::max(bottom, layer_at(track.top_m - kAtEdge_m));
  int voxels = 0, lowest = grid_.size_vox.z(), highest = -1;
  const auto voxels_in = [&](int z) {
    int count = 0;
    visit_layer(z, [&](int, int, std::uint64_t its) { count += std::popcount(its); });
    return count;
  };
  const auto take = [&](int z) {
    int count = 0;
    visit_layer(z, [&](int y, int word, std::uint64_t its) {
      count += std::popcount(its);
      if (masks) note_claim(y, z, word, its);
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
  const SeeThrough see_through(frame);
  const int turns = turns_of(frame);
  mask_.clear();
  for (std::size_t t = 0; t < trails_.size();) {
    Trail& trail = trails_[t];
    for (std::size_t i = 0; i < trail.claimed.size(); ++i) {
      trail.recent[i] |= trail.claimed[i];
      trail.seen_free[i] &= (trail.recent[i] | trail.older[i]) & ~trail.claimed[i];
    }
    if ((trail.y / kCell_vox + trail.z / kCell_vox + turn_) % turns == 0) {
      look_through(see_through, trail);
    }
    std::uint64_t any = 0;
    visit_beam(trail, [&](std::size_t i, std::size_t at) {
      const std::uint64_t before = trail.mask[i];
      trail.mask[i] = std::exchange(trail.claimed[i], 0) | trail.seen_free[i];
      if ((before | trail.mask[i]) != 0) mask_.push_back({at, before, trail.mask[i]});
      any |= trail.recent[i] | trail.older[i];
    });
    if (any != 0) {
      ++t;
      continue;
    }
    const Trail& last = trails_.back();
    trail_of_[beam_of(last.y, last.z, last.word)] = static_cast<std::uint32_t>(t + 1);
    trail_of_[beam_of(trail.y, trail.z, trail.word)] = 0;
    trail = last;
    trails_.pop_back();
  }
}

/// Among how many frames the cells of trails are shared.
int TrackMask::turns_of(const Frame& frame) {
  const Eigen::Vector3d eye_m = frame.T_world_camera.translation();
  const double since_s = stamp_.seconds() - looked_stamp_.seconds();
  const bool is_same_place = (eye_m - looked_from_m_).norm() < kOtherPlace_m;
  looked_stamp_ = stamp_;
  looked_from_m_ = eye_m;
  ++turn_;
  if (!is_same_place || since_s <= 0.0) return 1;
  return static_cast<int>(std::clamp(std::round(kLook_s / since_s), 1.0, double{kMostTurns}));
}

/// Notes what a frame sees through of what is left of a trail, and what it hits. Cells first: a
/// thing leaves tens of thousands of voxels of 2.5 cm, most of them in cells that are all seen
/// through or all hidden.
void TrackMask::look_through(const SeeThrough& see_through, Trail& trail) const {
  const double edge_m = kCell_vox * grid_.resolution_m;
  Beam left;
  std::uint64_t any = 0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    left[i] = (trail.recent[i] | trail.older[i]) & ~trail.claimed[i];
    any |= left[i];
  }
  while (any != 0) {
    const int x = std::countr_zero(any) / kCell_vox * kCell_vox;
    const std::uint64_t part = bits_between(x, x + kCell_vox - 1);
    any &= ~part;
    const Eigen::Vector3i first(64 * trail.word + x, trail.y, trail.z);
    const Eigen::Vector3d centre_m =
        grid_.origin_m + edge_m * ((first / kCell_vox).cast<double>().array() + 0.5).matrix();
    // Its corners first: most cells are hidden.
    auto answer = see_through(centre_m, edge_m, 2);
    if (answer != SeeThrough::Answer::kNo) answer = see_through(centre_m, edge_m, kRaysOfCell);
    if (answer == SeeThrough::Answer::kNo) continue;
    for (std::size_t i = 0; i < left.size(); ++i) {
      if (answer == SeeThrough::Answer::kYes) {
        trail.seen_free[i] |= left[i] & part;
        continue;
      }
      const Eigen::Vector3i in_beam(-x, static_cast<int>(i) % kCell_vox,
                                    static_cast<int>(i) / kCell_vox);
      for (std::uint64_t voxels = left[i] & part; voxels != 0; voxels &= voxels - 1) {
        const Eigen::Vector3i voxel =
            first + in_beam + Eigen::Vector3i(std::countr_zero(voxels), 0, 0);
        const auto its = see_through(grid_.centre_m(voxel), grid_.resolution_m, kRaysOfVoxel);
        const std::uint64_t bit = voxels & (~voxels + 1);
        if (its == SeeThrough::Answer::kYes) trail.seen_free[i] |= bit;
        if (its == SeeThrough::Answer::kHit) trail.seen_free[i] &= ~bit;
      }
    }
  }
}

MaskedOccupancy::MaskedOccupancy(Mapper& mapper, const OccupancyView& occupancy)
    : mapper_(mapper),
      occupancy_(occupancy),
      words_per_row_(occupancy.occupied().words_per_row),
      occupied_(occupancy.occupied().words.begin(), occupancy.occupied().words.end()) {}

void MaskedOccupancy::apply(std::span<const MaskedWord> mask, MapUpdate& update) {
  constexpr int kBlocksPerWord = 64 / kBlockSide_vox;
  const GridSpec& grid = mapper_.grid();
  const Eigen::Vector3i counts = block_counts(grid);
  const std::span<const std::uint64_t> full = occupancy_.occupied().words;
  const std::size_t rows = idx(words_per_row_), slice = idx(grid.size_vox.y());
  changed_.assign(idx(counts.prod()), 0);
  std::int64_t column_before = -1;
  for (const std::int32_t block : update.changed_blocks) {
    changed_[idx(block)] = 1;
    // Blocks side by side share words.
    const int word = block % counts.x() / kBlocksPerWord, row = block / counts.x();
    const std::int64_t column = std::int64_t{row} * words_per_row_ + word;
    if (std::exchange(column_before, column) == column) continue;
    const Eigen::Vector2i first =
        kBlockSide_vox * Eigen::Vector2i(row % counts.y(), row / counts.y());
    const Eigen::Vector2i last =
        (first.array() + kBlockSide_vox).min(grid.size_vox.tail<2>().array());
    for (int z = first.y(); z < last.y(); ++z) {
      std::size_t w = (idx(first.x()) + slice * idx(z)) * rows + idx(word);
      // The next layer is on its way meanwhile.
      const std::size_t ahead = z + 1 < last.y() ? slice * rows : 0;
      for (int y = first.x(); y < last.x(); ++y, w += rows) {
        __builtin_prefetch(full.data() + w + ahead);
        __builtin_prefetch(occupied_.data() + w + ahead);
        occupied_[w] = full[w];
      }
    }
  }
  for (const auto& [w, before, now] : mask) {
    occupied_[w] = full[w] & ~now;
    // Where the map itself has changed, it says so.
    const std::uint64_t differs = full[w] & (before ^ now);
    for (int part = 0; differs != 0 && part < kBlocksPerWord; ++part) {
      const int first = part * kBlockSide_vox;
      if ((differs & bits_between(first, first + kBlockSide_vox - 1)) == 0) continue;
      const Eigen::Vector3i block(static_cast<int>(w % rows) * kBlocksPerWord + part,
                                  static_cast<int>(w / rows % slice) / kBlockSide_vox,
                                  static_cast<int>(w / rows / slice) / kBlockSide_vox);
      changed_[idx(block_linear(block, counts))] = 1;
    }
  }
  update.changed_blocks.clear();
  for (std::size_t block = 0; block < changed_.size(); ++block) {
    if (changed_[block] != 0) update.changed_blocks.push_back(static_cast<std::int32_t>(block));
  }
}

}  // namespace sidestep
