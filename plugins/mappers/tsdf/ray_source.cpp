#include "ray_source.hpp"

#include <algorithm>
#include <cmath>

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
  std::uint64_t& word =
      cells.block(block_linear({block[0], block[1], block[2]}, counts_))[bit_index / 64];
  const std::uint64_t bit = std::uint64_t{1} << (bit_index % 64);
  const bool is_new = (word & bit) == 0;
  word |= bit;
  return is_new;
}

void StartCells::clear() noexcept {
  hits_.clear();
  free_.clear();
}

}  // namespace sidestep::tsdf
