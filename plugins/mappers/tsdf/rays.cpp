#include "rays.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/mapping/ray_ends.hpp>

namespace sidestep::tsdf {
namespace {

constexpr std::int32_t kNoBundle = -1;
/// Nearer than this the direction of a ray means nothing.
constexpr double kShortest_vox = 1e-6;
constexpr double kLeastDepth_m = 1e-6;

std::size_t bits_per_block(int cells_per_voxel) {
  const auto side = static_cast<std::size_t>(kBlockSide_vox * cells_per_voxel);
  return side * side * side;
}

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

RayMaker::RayMaker(const TsdfOptions& options, const RayEnds& ends, const Frame& frame)
    : ends_(ends),
      camera_vox_(ends.camera_vox()),
      optical_axis_(frame.T_world_camera.linear().col(2)),
      resolution_m_(options.resolution_m),
      inverse_square_(options.weighting == "inverse_square") {}

std::optional<Ray> RayMaker::to(const RayEnd& end) const {
  Ray ray;
  const Eigen::Vector3d along = end.p_vox - camera_vox_;
  ray.length_vox = along.norm();
  if (ray.length_vox < kShortest_vox) return std::nullopt;
  ray.end_vox = end.p_vox;
  ray.direction = along / ray.length_vox;
  ray.hit = end.hit;
  ray.weight = 1.0F;
  if (inverse_square_) {
    const double depth_m = along.dot(optical_axis_) * resolution_m_;
    if (std::abs(depth_m) < kLeastDepth_m) return std::nullopt;
    ray.weight = static_cast<float>(1.0 / (depth_m * depth_m));
  }
  return ray;
}

RayBundler::RayBundler(const GridSpec& grid)
    : grid_(grid),
      counts_(block_counts(grid)),
      hits_(static_cast<std::size_t>(counts_.prod()),
            kBlockSide_vox * kBlockSide_vox * kBlockSide_vox, kNoBundle),
      free_(static_cast<std::size_t>(counts_.prod()),
            kBlockSide_vox * kBlockSide_vox * kBlockSide_vox, kNoBundle) {}

void RayBundler::add(const Ray& ray) {
  const Eigen::Vector3i voxel = nearest_voxel(grid_, ray.end_vox);
  auto& slots = ray.hit ? hits_ : free_;
  std::int32_t& slot =
      slots.block(block_linear(voxel / kBlockSide_vox, counts_))[index_in_block(voxel)];
  if (slot == kNoBundle) {
    slot = static_cast<std::int32_t>(bundles_.size());
    bundles_.push_back({});
    bundles_.back().hit = ray.hit;
  } else if (!ray.hit) {
    return;
  }
  Bundle& bundle = bundles_[static_cast<std::size_t>(slot)];
  const auto weight = static_cast<double>(ray.weight);
  bundle.weighted_sum_vox += weight * ray.end_vox;
  bundle.weight += weight;
}

std::vector<Ray> RayBundler::take(const RayMaker& maker) {
  std::vector<Ray> rays;
  rays.reserve(bundles_.size());
  for (const Bundle& bundle : bundles_) {
    auto ray = maker.to({bundle.weighted_sum_vox / bundle.weight, bundle.hit});
    if (!ray) continue;
    ray->weight = static_cast<float>(bundle.weight);
    rays.push_back(*ray);
  }
  bundles_.clear();
  hits_.clear();
  free_.clear();
  return rays;
}

StartCells::StartCells(const TsdfOptions& options)
    : size_cells_(options.size_vox * options.start_cells_per_voxel),
      counts_(block_counts(options.grid())),
      per_voxel_(options.start_cells_per_voxel),
      hits_(static_cast<std::size_t>(counts_.prod()), bits_per_block(per_voxel_) / 64, 0),
      free_(static_cast<std::size_t>(counts_.prod()), bits_per_block(per_voxel_) / 64, 0) {}

bool StartCells::insert(const RayEnd& end) {
  const int side = kBlockSide_vox * per_voxel_;
  int block[3];
  int cell[3];
  for (int a = 0; a < 3; ++a) {
    // An end lies in the grid but for rounding; toward zero is down.
    const int c = std::clamp(static_cast<int>(end.p_vox[a] * per_voxel_), 0, size_cells_[a] - 1);
    block[a] = c / side;
    cell[a] = c % side;
  }
  const int bit_index = cell[0] + side * (cell[1] + side * cell[2]);
  auto& cells = end.hit ? hits_ : free_;
  return !test_and_set(cells.block(block_linear({block[0], block[1], block[2]}, counts_)),
                       bit_index);
}

void StartCells::clear() noexcept {
  hits_.clear();
  free_.clear();
}

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
