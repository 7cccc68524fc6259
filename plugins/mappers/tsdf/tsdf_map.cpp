#include "tsdf_map.hpp"

#include <algorithm>
#include <array>

#include <sidestep/core/index.hpp>

namespace sidestep::tsdf {
namespace {

constexpr int kRows = kBlockSide_vox * kBlockSide_vox;
/// Less than this is no observation (Voxblox: kFloatEpsilon).
constexpr float kLeastWeight = 1e-6F;
/// A voxel in which a surface lies has its centre at most half its diagonal before or behind it.
constexpr float kHalfDiagonal_vox = 0.8660254F;
constexpr float kOccupiedBelow_vox = 0.5F;
constexpr int kBlocksATask = 4;

std::vector<std::int32_t> flagged(const std::vector<std::uint8_t>& flags) {
  std::vector<std::int32_t> blocks;
  for (std::size_t b = 0; b < flags.size(); ++b) {
    if (flags[b] != 0) blocks.push_back(static_cast<std::int32_t>(b));
  }
  return blocks;
}

/// Replaces 16 bits of a word that other threads may be changing elsewhere.
void replace_bits(std::uint64_t& word, std::uint64_t difference, int shift) noexcept {
  std::atomic_ref<std::uint64_t>(word).fetch_xor(difference << shift, std::memory_order_relaxed);
}

}  // namespace

struct TsdfMap::TouchedRows {
  std::array<bool, kRows> row{};
};

TsdfMap::TsdfMap(const TsdfOptions& options, WorkerPool& workers)
    : grid_(options.grid()),
      counts_(block_counts(grid_)),
      workers_(workers),
      resolution_m_(static_cast<float>(options.resolution_m)),
      truncation_m_(static_cast<float>(options.truncation_vox * options.resolution_m)),
      max_weight_(static_cast<float>(options.max_weight)),
      dropoff_(options.weight_dropoff),
      blocks_(static_cast<std::size_t>(counts_.prod())),
      words_per_row_((grid_.size_vox.x() + 63) / 64),
      occupancy_changed_(blocks_.size()),
      distance_changed_(blocks_.size()),
      block_begin_(blocks_.size() + 1) {
  const std::size_t words = static_cast<std::size_t>(words_per_row_) *
                            static_cast<std::size_t>(grid_.size_vox.y()) *
                            static_cast<std::size_t>(grid_.size_vox.z());
  occupied_.resize(words);
  known_.resize(words);
}

void TsdfMap::begin_frame() {
  std::ranges::fill(occupancy_changed_, std::uint8_t{0});
  std::ranges::fill(distance_changed_, std::uint8_t{0});
}

std::vector<std::int32_t> TsdfMap::changed_occupancy() const { return flagged(occupancy_changed_); }
std::vector<std::int32_t> TsdfMap::changed_distances() const { return flagged(distance_changed_); }

void TsdfMap::integrate(std::span<const Trace> traces, const Eigen::Vector3d& camera_vox) {
  sort_by_block(traces);
  workers_.run_banded(static_cast<int>(touched_.size()), kBlocksATask, [&](int begin, int end) {
    for (int t = begin; t < end; ++t) {
      const std::int32_t block = touched_[idx(t)];
      const std::size_t from = block_begin_[idx(block)];
      const std::size_t to = block_begin_[static_cast<std::size_t>(block) + 1];
      integrate_block(block, std::span(sorted_).subspan(from, to - from), traces, camera_vox);
    }
  });
}

/// Counting sort: within a block the segments keep the order of traces and rays.
void TsdfMap::sort_by_block(std::span<const Trace> traces) {
  std::ranges::fill(block_begin_, 0U);
  std::size_t total = 0;
  for (const Trace& trace : traces) {
    total += trace.segments.size();
    for (const Segment& s : trace.segments) ++block_begin_[idx(s.block)];
  }
  touched_.clear();
  std::uint32_t end = 0;
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    if (block_begin_[b] != 0) touched_.push_back(static_cast<std::int32_t>(b));
    end += block_begin_[b];
    block_begin_[b] = end;
  }
  block_begin_.back() = end;
  sorted_.resize(total);
  for (std::size_t t = traces.size(); t-- > 0;) {
    const auto& segments = traces[t].segments;
    for (std::size_t s = segments.size(); s-- > 0;) {
      sorted_[--block_begin_[idx(segments[s].block)]] = {static_cast<std::uint32_t>(t),
                                                         static_cast<std::uint32_t>(s)};
    }
  }
}

void TsdfMap::integrate_block(std::int32_t block, std::span<const SegmentRef> segments,
                              std::span<const Trace> traces, const Eigen::Vector3d& camera_vox) {
  auto& out = blocks_[idx(block)];
  if (!out) out = std::make_unique<TsdfBlock>();
  const Eigen::Vector3i index(block % counts_.x(), block / counts_.x() % counts_.y(),
                              block / (counts_.x() * counts_.y()));
  const Eigen::Vector3d first_centre_vox =
      (index * kBlockSide_vox).cast<double>() + Eigen::Vector3d::Constant(0.5);
  TouchedRows touched;
  bool changed = false;
  for (const SegmentRef& ref : segments) {
    const Trace& trace = traces[ref.trace];
    const Segment& segment = trace.segments[ref.segment];
    changed |=
        integrate_segment(*out, first_centre_vox - camera_vox, trace.rays[segment.ray],
                          std::span(trace.voxels).subspan(segment.first, segment.count), touched);
  }
  if (!changed) return;
  distance_changed_[idx(block)] = 1;
  bool occupancy_changed = false;
  for (int row = 0; row < kRows; ++row) {
    if (touched.row[idx(row)]) {
      occupancy_changed |= refresh_row(index, *out, row);
    }
  }
  if (occupancy_changed) occupancy_changed_[idx(block)] = 1;
}

/// Oleynikova et al. 2017, Sec. IV: distances along the ray, averaged by weight. What lies
/// far before the surface is cut off only after the average, so that a ray that passes through
/// what was a surface clears it the faster the farther it goes.
bool TsdfMap::integrate_segment(TsdfBlock& out, const Eigen::Vector3d& from_camera_vox,
                                const Ray& ray, std::span<const std::uint16_t> voxels,
                                TouchedRows& touched) const {
  const float first_m =
      static_cast<float>(ray.length_vox - from_camera_vox.dot(ray.direction)) * resolution_m_;
  const Eigen::Vector3f step_m = ray.direction.cast<float>() * resolution_m_;
  const float least_m = ray.hit ? -2.0F * truncation_m_ : truncation_m_;
  const float dropoff_scale = 1.0F / (truncation_m_ - resolution_m_);
  bool changed = false;
  for (const std::uint16_t v : voxels) {
    const float x = static_cast<float>(v % kBlockSide_vox);
    const float y = static_cast<float>(v / kBlockSide_vox % kBlockSide_vox);
    const float z = static_cast<float>(v / kRows);
    const float sdf_m =
        std::max(least_m, first_m - (x * step_m.x() + y * step_m.y() + z * step_m.z()));
    float weight = ray.weight;
    if (dropoff_ && sdf_m < -resolution_m_) {
      weight = std::max(0.0F, weight * (truncation_m_ + sdf_m) * dropoff_scale);
    }
    const float old_weight = out.weight[v];
    const float sum = old_weight + weight;
    if (sum < kLeastWeight) continue;
    const float old_m = out.distance_m[v];
    const float new_m =
        std::clamp((sdf_m * weight + old_m * old_weight) / sum, -truncation_m_, truncation_m_);
    changed |= new_m != old_m || old_weight == 0.0F;
    out.distance_m[v] = new_m;
    out.weight[v] = std::min(max_weight_, sum);
    touched.row[v / kBlockSide_vox] = true;
  }
  return changed;
}

/// Known: seen to lie before a surface or, by less than half a voxel's diagonal, behind it; for
/// good. Occupied: known, and less than half a voxel before a surface, or behind it.
bool TsdfMap::refresh_row(const Eigen::Vector3i& block_index, const TsdfBlock& block, int row) {
  const float occupied_below_m = kOccupiedBelow_vox * resolution_m_;
  const float known_above_m = -kHalfDiagonal_vox * resolution_m_;
  unsigned near = 0;
  unsigned seen = 0;
  for (int x = 0; x < kBlockSide_vox; ++x) {
    const auto v = static_cast<std::size_t>(row * kBlockSide_vox + x);
    const bool observed = block.weight[v] > 0.0F;
    near |= static_cast<unsigned>(observed && block.distance_m[v] < occupied_below_m) << x;
    seen |= static_cast<unsigned>(observed && block.distance_m[v] > known_above_m) << x;
  }
  const int y = block_index.y() * kBlockSide_vox + row % kBlockSide_vox;
  const int z = block_index.z() * kBlockSide_vox + row / kBlockSide_vox;
  const std::size_t word =
      (static_cast<std::size_t>(y) +
       static_cast<std::size_t>(grid_.size_vox.y()) * static_cast<std::size_t>(z)) *
          static_cast<std::size_t>(words_per_row_) +
      static_cast<std::size_t>(block_index.x()) / 4;
  const int shift = block_index.x() % 4 * kBlockSide_vox;
  const auto bits = [shift](std::uint64_t& from) {
    return static_cast<unsigned>(
               std::atomic_ref<std::uint64_t>(from).load(std::memory_order_relaxed) >> shift) &
           0xffffU;
  };
  const unsigned old_known = bits(known_[word]);
  const unsigned old_occupied = bits(occupied_[word]);
  const unsigned known = old_known | seen;
  const unsigned occupied = known & near;
  if (known == old_known && occupied == old_occupied) return false;
  replace_bits(known_[word], known ^ old_known, shift);
  replace_bits(occupied_[word], occupied ^ old_occupied, shift);
  return true;
}

}  // namespace sidestep::tsdf
