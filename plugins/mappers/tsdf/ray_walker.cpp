#include "ray_walker.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/mapping/ray_ends.hpp>

namespace sidestep::tsdf {
namespace {

constexpr std::size_t kWordsPerBlock = kBlockSide_vox * kBlockSide_vox * kBlockSide_vox / 64;

/// Whether the voxel was in the set; it is afterwards.
bool test_and_set(std::uint64_t* words, int index) noexcept {
  std::uint64_t& word = words[index / 64];
  const std::uint64_t bit = std::uint64_t{1} << (index % 64);
  const bool was = (word & bit) != 0;
  word |= bit;
  return was;
}

}  // namespace

RayWalker::RayWalker(const TsdfOptions& options)
    : grid_(options.grid()),
      counts_(block_counts(grid_)),
      truncation_vox_(options.truncation_vox),
      carving_(options.carving),
      stops_early_(options.integrator == "fast"),
      max_collisions_(options.max_consecutive_collisions),
      seen_(stops_early_ ? static_cast<std::size_t>(counts_.prod()) : 0, kWordsPerBlock, 0) {}

void RayWalker::walk_all(const Eigen::Vector3d& camera_vox, Trace& trace) {
  for (std::size_t r = 0; r < trace.rays.size(); ++r) {
    const auto way = course(camera_vox, trace.rays[r]);
    if (!way) continue;
    if (stops_early_) {
      walk<true>(*way, static_cast<std::uint32_t>(r), trace);
    } else {
      walk<false>(*way, static_cast<std::uint32_t>(r), trace);
    }
  }
  seen_.clear();
}

std::optional<RayWalker::Course> RayWalker::course(const Eigen::Vector3d& camera_vox,
                                                   const Ray& ray) const {
  Eigen::Vector3d far = ray.end_vox;
  if (ray.hit) far += truncation_vox_ * ray.direction;
  Eigen::Vector3d near = camera_vox;
  if (!carving_) {
    // Free space alone says nothing that the truncated band needs.
    if (!ray.hit) return std::nullopt;
    near = ray.end_vox - std::min(truncation_vox_, ray.length_vox) * ray.direction;
  }
  const auto part = clip_to_box(far, near, grid_.size_vox.cast<double>());
  if (!part) return std::nullopt;
  const Eigen::Vector3d along = near - far;
  const Eigen::Vector3i first = nearest_voxel(grid_, far + part->enter * along);
  // The walk moves one way along each axis, so that steps count how far it has come.
  const int steps_to_end = (nearest_voxel(grid_, ray.end_vox) - first).cwiseAbs().sum();
  return Course{first, nearest_voxel(grid_, far + part->leave * along), far, along, steps_to_end};
}

template <bool kStopsEarly>
void RayWalker::walk(const Course& course, std::uint32_t ray, Trace& trace) {
  constexpr double kNever = std::numeric_limits<double>::infinity();
  constexpr int kIndexStep[3] = {1, kBlockSide_vox, kBlockSide_vox * kBlockSide_vox};
  const int block_step[3] = {1, counts_.x(), counts_.x() * counts_.y()};
  int at[3];
  int step[3];
  int left[3];     // steps to go along each axis: the walk always ends in its last voxel
  double next[3];  // parameter at which the ray leaves the voxel along each axis
  double delta[3];
  int steps = 0;
  for (int a = 0; a < 3; ++a) {
    at[a] = course.voxel[a];
    step[a] = course.last[a] > at[a] ? 1 : -1;
    left[a] = std::abs(course.last[a] - at[a]);
    steps += left[a];
    const double plane = at[a] + (step[a] > 0 ? 1.0 : 0.0);
    delta[a] = 1.0 / std::abs(course.along_vox[a]);
    next[a] = left[a] == 0 ? kNever : (plane - course.from_vox[a]) / course.along_vox[a];
  }
  const std::size_t begin = trace.voxels.size();
  trace.voxels.resize(begin + static_cast<std::size_t>(steps) + 1);
  std::uint16_t* const first = trace.voxels.data() + begin;
  std::uint16_t* out = first;
  std::uint16_t* segment_begin = out;
  std::int32_t block = block_linear(course.voxel / kBlockSide_vox, counts_);
  int index = index_in_block(course.voxel);
  std::uint64_t* seen = kStopsEarly ? seen_.block(block) : nullptr;
  const auto close_segment = [&] {
    trace.segments.push_back(
        {block, ray,
         static_cast<std::uint32_t>(segment_begin - first) + static_cast<std::uint32_t>(begin),
         static_cast<std::uint32_t>(out - segment_begin)});
    segment_begin = out;
  };
  const int steps_past_end = steps - course.steps_to_end;
  for (int collisions = 0;; --steps) {
    if constexpr (kStopsEarly) {
      const bool counts = test_and_set(seen, index) && steps < steps_past_end;
      collisions = counts ? collisions + 1 : 0;
      if (collisions > max_collisions_) break;
    }
    *out++ = static_cast<std::uint16_t>(index);
    if (steps == 0) break;
    int a = next[0] < next[1] ? 0 : 1;
    a = next[2] < next[a] ? 2 : a;
    next[a] = --left[a] == 0 ? kNever : next[a] + delta[a];
    const int was = at[a];
    at[a] += step[a];
    index += step[a] * kIndexStep[a];
    if (((was ^ at[a]) & kBlockSide_vox) != 0) {
      close_segment();
      block += step[a] * block_step[a];
      index -= step[a] * kIndexStep[a] * kBlockSide_vox;
      if constexpr (kStopsEarly) seen = seen_.block(block);
    }
  }
  if (out != segment_begin) close_segment();
  trace.voxels.resize(begin + static_cast<std::size_t>(out - first));
}

}  // namespace sidestep::tsdf
