#include "distance_waves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

#include <sidestep/core/index.hpp>

namespace sidestep::esdf {
namespace {

/// Which third of an axis a coordinate belongs to: the low end, between, the high end.
constexpr int end_of(int coordinate) {
  return coordinate == 0 ? 0 : (coordinate == kBlockSide_vox - 1 ? 2 : 1);
}

constexpr std::uint32_t kVoxelsPerBlock = TsdfBlock::kVoxels;
/// Less than this is no observation.
constexpr float kLeastWeight = 1e-6F;

template <class Value>
Value* zeroed(std::size_t count) {
  auto* memory = static_cast<Value*>(std::calloc(count, sizeof(Value)));
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

Eigen::Vector3i with_rim(const GridSpec& grid) {
  return block_counts(grid) + Eigen::Vector3i::Constant(2);
}

}  // namespace

Neighbours::Neighbours(const Eigen::Vector3i& blocks, double resolution_m) {
  std::size_t count = 0;
  for (int code = 0; code < 27; ++code) {
    const Eigen::Vector3i direction(code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1);
    if (direction.isZero()) continue;
    directions_[count] = direction;
    steps_m_[count] =
        static_cast<float>(resolution_m * std::sqrt(static_cast<double>(direction.squaredNorm())));
    ++count;
  }
  const int voxel_stride[3] = {1, kBlockSide_vox, kBlockSide_vox * kBlockSide_vox};
  const int block_stride[3] = {static_cast<int>(kVoxelsPerBlock),
                               static_cast<int>(kVoxelsPerBlock) * blocks.x(),
                               static_cast<int>(kVoxelsPerBlock) * blocks.x() * blocks.y()};
  for (int place = 0; place < kPlaces; ++place) {
    const int ends[3] = {place % 3, place / 3 % 3, place / 9};
    for (std::size_t d = 0; d < kCount; ++d) {
      std::int32_t offset = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const int step = directions_[d][axis];
        const bool leaves = (step < 0 && ends[axis] == 0) || (step > 0 && ends[axis] == 2);
        offset += step * (leaves ? block_stride[axis] - (kBlockSide_vox - 1) * voxel_stride[axis]
                                 : voxel_stride[axis]);
      }
      offsets_[static_cast<std::size_t>(place)][d] = offset;
    }
  }
  for (int v = 0; v < static_cast<int>(kVoxelsPerBlock); ++v) {
    place_[static_cast<std::size_t>(v)] = static_cast<std::uint8_t>(
        end_of(v % kBlockSide_vox) + 3 * (end_of(v / kBlockSide_vox % kBlockSide_vox) +
                                          3 * end_of(v / (kBlockSide_vox * kBlockSide_vox))));
  }
}

void DistanceWaves::BlockChanges::clear() {
  raised.clear();
  fixed.clear();
  orphans.clear();
  flipped.clear();
}

bool DistanceWaves::fits(const GridSpec& grid, double max_distance_m) {
  // Differences of indices are 32 bits wide, with a sign.
  return with_rim(grid).cast<double>().prod() * kVoxelsPerBlock <
             std::numeric_limits<std::int32_t>::max() &&
         max_distance_m / grid.resolution_m < std::numeric_limits<std::int16_t>::max();
}

DistanceWaves::DistanceWaves(const WaveSettings& settings, WorkerPool& workers)
    : settings_(settings),
      workers_(workers),
      counts_(block_counts(settings.grid)),
      stored_counts_(with_rim(settings.grid)),
      neighbours_(stored_counts_, settings.grid.resolution_m),
      prepared_(static_cast<std::size_t>(stored_counts_.prod())),
      changed_(prepared_.size()),
      buckets_(static_cast<std::size_t>(static_cast<double>(settings.max_distance_m) /
                                        settings.grid.resolution_m) +
               2) {
  const std::size_t voxels = prepared_.size() * kVoxelsPerBlock;
  distance_m_.reset(zeroed<float>(voxels));
  state_.reset(zeroed<std::uint8_t>(voxels));
  if (settings.full_euclidean) offset_.reset(zeroed<Offset>(voxels));
}

std::size_t DistanceWaves::stored_block(const Eigen::Vector3i& block) const noexcept {
  return static_cast<std::size_t>(block_linear(block + Eigen::Vector3i::Ones(), stored_counts_));
}

std::uint32_t DistanceWaves::stored_voxel(int x, int y, int z) const noexcept {
  const std::size_t block =
      stored_block({x / kBlockSide_vox, y / kBlockSide_vox, z / kBlockSide_vox});
  return static_cast<std::uint32_t>(block) * kVoxelsPerBlock +
         static_cast<std::uint32_t>(
             x % kBlockSide_vox +
             kBlockSide_vox * (y % kBlockSide_vox + kBlockSide_vox * (z % kBlockSide_vox)));
}

Eigen::Vector3i DistanceWaves::block_at(std::int32_t block) const noexcept {
  return {block % counts_.x(), block / counts_.x() % counts_.y(),
          block / (counts_.x() * counts_.y())};
}

void DistanceWaves::update(const TsdfView& tsdf, std::span<const std::int32_t> changed_blocks) {
  std::ranges::fill(changed_, std::uint8_t{0});
  std::vector<std::int32_t> blocks;
  std::ranges::copy_if(changed_blocks, std::back_inserter(blocks),
                       [&](std::int32_t b) { return tsdf.tsdf_block(b) != nullptr; });
  prepare_reach(blocks);
  if (changes_.size() < blocks.size()) changes_.resize(blocks.size());
  workers_.run_banded(static_cast<int>(blocks.size()), 8, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      const auto at = static_cast<std::size_t>(i);
      changes_[at].clear();
      const std::size_t stored = stored_block(block_at(blocks[at]));
      scan(*tsdf.tsdf_block(blocks[at]), static_cast<std::uint32_t>(stored) * kVoxelsPerBlock,
           changes_[at]);
    }
  });
  const std::span<const BlockChanges> changes(changes_.data(), blocks.size());
  orphans_.clear();
  raise(changes);
  if (settings_.full_euclidean) {
    spread<true>(changes);
  } else {
    spread<false>(changes);
  }
}

template <bool kFull>
void DistanceWaves::spread(std::span<const BlockChanges> changes) {
  seed<kFull>(changes);
  do {  // once, but for full Euclidean waves that take children from their parents
    adopting_.swap(orphans_);
    orphans_.clear();
    for (const std::uint32_t voxel : adopting_) adopt<kFull>(voxel);
    lower<kFull>();
  } while (!orphans_.empty());
}

/// Waves enter voxels of prepared blocks only; they come no farther than the largest distance.
void DistanceWaves::prepare_reach(std::span<const std::int32_t> blocks) {
  const int reach =
      settings_.unknown == Unknown::kIgnored
          ? 0
          : static_cast<int>(std::ceil(static_cast<double>(settings_.max_distance_m) /
                                       (settings_.grid.resolution_m * kBlockSide_vox)));
  for (const std::int32_t b : blocks) {
    const Eigen::Vector3i block = block_at(b);
    // A block is marked 2 once all around it are prepared.
    std::uint8_t& mark = prepared_[stored_block(block)];
    if (mark == 2) continue;
    const Eigen::Vector3i low = (block.array() - reach).max(0).matrix();
    const Eigen::Vector3i high = (block.array() + reach).min(counts_.array() - 1).matrix();
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) prepare({x, y, z});
      }
    }
    mark = 2;
  }
}

void DistanceWaves::prepare(const Eigen::Vector3i& block) {
  std::uint8_t& mark = prepared_[stored_block(block)];
  if (mark != 0) return;
  mark = 1;
  if (settings_.unknown == Unknown::kIgnored) return;
  const Eigen::Vector3i first = block * kBlockSide_vox;
  const Eigen::Vector3i size =
      (settings_.grid.size_vox - first).cwiseMin(Eigen::Vector3i::Constant(kBlockSide_vox));
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      const std::uint32_t row = stored_voxel(first.x(), first.y() + y, first.z() + z);
      std::fill_n(distance_m_.get() + row, size.x(), settings_.max_distance_m);
      std::fill_n(state_.get() + row, size.x(),
                  settings_.unknown == Unknown::kOccupied ? kNegative : std::uint8_t{0});
    }
  }
}

void DistanceWaves::scan(const TsdfBlock& tsdf, std::uint32_t first, BlockChanges& changes) {
  for (std::uint32_t v = 0; v < kVoxelsPerBlock; ++v) {
    if (tsdf.weight[v] >= kLeastWeight) scan_voxel(first + v, tsdf.distance_m[v], changes);
  }
  if (!changes.raised.empty() || !changes.fixed.empty()) changed_[first / kVoxelsPerBlock] = 1;
}

void DistanceWaves::scan_voxel(std::uint32_t voxel, float tsdf_m, BlockChanges& changes) {
  const float size_m = std::abs(tsdf_m);
  const std::uint8_t old = state_[voxel];
  const auto kind = static_cast<std::uint8_t>((tsdf_m < 0.0F ? kNegative : 0) |
                                              (size_m < settings_.band_m ? kFixed : 0));
  const bool took_part = takes_part(voxel);
  const bool same_region = took_part && ((old ^ kind) & kNegative) == 0;
  float& distance_m = distance_m_[voxel];
  if ((kind & kFixed) == 0) {
    if (same_region && (old & kFixed) == 0) return;
    distance_m = settings_.max_distance_m;
    changes.raised.push_back(voxel);
    changes.orphans.push_back(voxel);
  } else {
    if (same_region && (old & kFixed) != 0 &&
        std::abs(size_m - distance_m) <= settings_.min_change_m) {
      return;
    }
    // Full Euclidean waves begin anew at a voxel that becomes fixed.
    const bool begins = settings_.full_euclidean && (old & kFixed) == 0;
    if (!same_region || size_m > distance_m || begins) changes.raised.push_back(voxel);
    changes.fixed.push_back(voxel);
    distance_m = size_m;
  }
  state_[voxel] = kind;
  if (!same_region) changes.flipped.push_back(voxel);
  if (settings_.full_euclidean) offset_[voxel] = {};
}

void DistanceWaves::raise(std::span<const BlockChanges> changes) {
  raising_.clear();
  for (const BlockChanges& block : changes) {
    raising_.insert(raising_.end(), block.raised.begin(), block.raised.end());
    orphans_.insert(orphans_.end(), block.orphans.begin(), block.orphans.end());
  }
  raise_children();
}

void DistanceWaves::raise_children() {
  while (!raising_.empty()) {
    const std::uint32_t voxel = raising_.back();
    raising_.pop_back();
    const auto& offsets = neighbours_.offsets(voxel);
    for (int d = 0; d < Neighbours::kCount; ++d) {
      const std::uint32_t child = voxel + static_cast<std::uint32_t>(offsets[idx(d)]);
      if ((state_[child] & kParent) != 1 + Neighbours::opposite(d)) continue;
      state_[child] = state_[child] & kNegative;
      distance_m_[child] = settings_.max_distance_m;
      changed_[child / kVoxelsPerBlock] = 1;
      raising_.push_back(child);
      orphans_.push_back(child);
    }
  }
}

template <bool kFull>
void DistanceWaves::seed(std::span<const BlockChanges> changes) {
  for (const BlockChanges& block : changes) {
    for (const std::uint32_t voxel : block.fixed) push(voxel);
    for (const std::uint32_t voxel : block.flipped) {
      const auto& offsets = neighbours_.offsets(voxel);
      for (int d = 0; d < Neighbours::kCount; ++d) {
        const auto at = static_cast<std::size_t>(d);
        const std::uint32_t other = voxel + static_cast<std::uint32_t>(offsets[at]);
        const bool across = ((state_[other] ^ state_[voxel]) & kNegative) != 0;
        const float step_m = neighbours_.steps_m()[at];
        if (!across || (state_[other] & kFixed) != 0 || step_m >= distance_m_[other]) continue;
        accept<kFull>(other, step_m, Neighbours::opposite(d), true);
      }
    }
  }
}

/// Gives a voxel the best that its neighbours offer.
template <bool kFull>
void DistanceWaves::adopt(std::uint32_t voxel) {
  const auto& offsets = neighbours_.offsets(voxel);
  float best_m = distance_m_[voxel];
  int best = -1;
  bool crosses = false;
  for (int d = 0; d < Neighbours::kCount; ++d) {
    const auto at = static_cast<std::size_t>(d);
    const std::uint32_t other = voxel + static_cast<std::uint32_t>(offsets[at]);
    if (!takes_part(other)) continue;
    const bool across = ((state_[other] ^ state_[voxel]) & kNegative) != 0;
    const float offer_m =
        across ? neighbours_.steps_m()[at] : offer<kFull>(other, Neighbours::opposite(d));
    if (offer_m >= best_m) continue;
    best_m = offer_m;
    best = d;
    crosses = across;
  }
  if (best >= 0) accept<kFull>(voxel, best_m, best, crosses);
}

template <bool kFull>
void DistanceWaves::lower() {
  for (auto& bucket : buckets_) {
    for (std::size_t next = 0; next < bucket.size(); ++next) {  // it may grow meanwhile
      const std::uint32_t voxel = bucket[next];
      const std::uint8_t state = state_[voxel];
      if ((state & kQueued) == 0) continue;  // served from a nearer bucket
      state_[voxel] = state & static_cast<std::uint8_t>(~kQueued);
      const float distance_m = distance_m_[voxel];
      const auto& offsets = neighbours_.offsets(voxel);
      for (int d = 0; d < Neighbours::kCount; ++d) {
        const auto at = static_cast<std::size_t>(d);
        const std::uint32_t other = voxel + static_cast<std::uint32_t>(offsets[at]);
        // Between regions nothing is to be done: those offers do not depend on this value.
        if constexpr (kFull) {
          if (distance_m >= distance_m_[other]) continue;
          const float offer_m = offer<true>(voxel, d);
          if (offer_m >= distance_m_[other]) continue;
          if (((state_[other] & kFixed) | ((state_[other] ^ state) & kNegative)) != 0) continue;
          accept<true>(other, offer_m, Neighbours::opposite(d), false);
        } else {
          const float offer_m = distance_m + neighbours_.steps_m()[at];
          if (offer_m >= distance_m_[other]) continue;
          if (((state_[other] & kFixed) | ((state_[other] ^ state) & kNegative)) != 0) continue;
          accept<false>(other, offer_m, Neighbours::opposite(d), false);
        }
      }
    }
    bucket.clear();
  }
}

template <bool kFull>
float DistanceWaves::offer(std::uint32_t from, int d) const noexcept {
  if constexpr (kFull) {
    const Offset& o = offset_[from];
    const Eigen::Vector3f before(o.x, o.y, o.z);
    const Eigen::Vector3f after = before + neighbours_.direction(d).cast<float>();
    const float longer = after.norm() - before.norm();
    if (longer <= 0.0F) return std::numeric_limits<float>::infinity();
    return distance_m_[from] + longer * static_cast<float>(settings_.grid.resolution_m);
  } else {
    return distance_m_[from] + neighbours_.steps_m()[idx(d)];
  }
}

template <bool kFull>
void DistanceWaves::accept(std::uint32_t voxel, float distance_m, int direction_to_parent,
                           bool crosses) {
  // A child whose path led through this voxel to where another wave began would not be raised
  // when that place changes: it has to start anew. With quasi-Euclidean steps a lower value of
  // the parent is a lower one of the child.
  if (kFull && (state_[voxel] & kParent) != 0) {
    raising_.push_back(voxel);
    raise_children();
  }
  const auto kept = static_cast<std::uint8_t>(state_[voxel] & ~kParent);
  state_[voxel] = static_cast<std::uint8_t>(kept | (1 + direction_to_parent));
  distance_m_[voxel] = distance_m;
  changed_[voxel / kVoxelsPerBlock] = 1;
  if constexpr (kFull) {
    const Eigen::Vector3i& d = neighbours_.direction(direction_to_parent);
    const auto parent =
        static_cast<std::uint32_t>(neighbours_.offsets(voxel)[idx(direction_to_parent)]);
    const Offset from = crosses ? Offset{} : offset_[voxel + parent];
    offset_[voxel] = {static_cast<std::int16_t>(from.x - d.x()),
                      static_cast<std::int16_t>(from.y - d.y()),
                      static_cast<std::int16_t>(from.z - d.z())};
  } else {
    (void)crosses;
  }
  push(voxel);
}

void DistanceWaves::push(std::uint32_t voxel) {
  const auto bucket = static_cast<std::size_t>(static_cast<double>(distance_m_[voxel]) /
                                               settings_.grid.resolution_m);
  buckets_[std::min(bucket, buckets_.size() - 1)].push_back(voxel);
  state_[voxel] |= kQueued;
}

void DistanceWaves::flag_changed(std::vector<std::uint8_t>& flags) const {
  for (std::size_t b = 0; b < flags.size(); ++b) {
    if (changed_[stored_block(block_at(static_cast<std::int32_t>(b)))] != 0) flags[b] = 1;
  }
}

void DistanceWaves::row(int x, int y, int z, int count, float* distances_m) const {
  if (prepared_[stored_block({x / kBlockSide_vox, y / kBlockSide_vox, z / kBlockSide_vox})] == 0) {
    std::fill_n(distances_m, count,
                settings_.unknown == Unknown::kOccupied ? -settings_.max_distance_m
                                                        : settings_.max_distance_m);
    return;
  }
  const std::uint32_t first = stored_voxel(x, y, z);
  for (int i = 0; i < count; ++i) {
    const std::uint32_t voxel = first + static_cast<std::uint32_t>(i);
    const float distance_m = takes_part(voxel) ? distance_m_[voxel] : settings_.max_distance_m;
    distances_m[i] = (state_[voxel] & kNegative) != 0 ? -distance_m : distance_m;
  }
}

}  // namespace sidestep::esdf
