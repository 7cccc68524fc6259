#include "carve_image.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

#include <sidestep/mapping/ray_ends.hpp>

namespace sidestep::voxel_grid {
namespace {

void count_pixels(const PixelFates& fates, int pixels, IntegrationCounts& counts) {
  const auto of = [&](PointFate fate) { return fates.count[static_cast<std::size_t>(fate)]; };
  counts.points += pixels - of(PointFate::kInvalid);
  counts.invalid += of(PointFate::kInvalid);
  counts.floor += of(PointFate::kFloor);
  counts.out_of_range += of(PointFate::kOutOfRange);
  counts.inserted += of(PointFate::kInsert);
  counts.self += fates.count[PixelFates::kSelf];
  counts.outside_grid += fates.count[PixelFates::kOutside];
}

}  // namespace

CarveImage::CarveImage(const GridSpec& grid, const PointRules& rules, bool clear_no_return,
                       float band_m)
    : max_range_m_(rules.max_range_m) {
  rules_.min_range_sq = static_cast<float>(rules.min_range_m * rules.min_range_m);
  rules_.max_range_m = static_cast<float>(rules.max_range_m);
  rules_.floor_top_vox =
      static_cast<float>((rules.floor_top_m() - grid.origin_m.z()) / grid.resolution_m);
  rules_.band_m = band_m;
  rules_.clear_no_return = clear_no_return;
  for (int c = 0; c < 3; ++c) rules_.size_vox[c] = static_cast<float>(grid.size_vox[c]);
}

IntegrationCounts CarveImage::read(const Frame& frame, const DepthImage& image,
                                   const GridSpec& grid, const SelfFilter& self, VoxelMarks& hits,
                                   WorkerPool& workers) {
  const CameraIntrinsics& camera = image.camera;
  carve_m_.resize(image.depth_m.size());
  tiles_u_ = (camera.width_px + kTile_px - 1) / kTile_px;
  const int tiles_v = (camera.height_px + kTile_px - 1) / kTile_px;
  tiles_.resize(static_cast<std::size_t>(tiles_u_) * static_cast<std::size_t>(tiles_v));
  project_balls(frame, camera, self);

  const Eigen::Matrix3d rotation_vox = frame.T_world_camera.linear() / grid.resolution_m;
  const Eigen::Vector3d start_vox =
      (frame.T_world_camera.translation() - grid.origin_m) / grid.resolution_m;
  std::vector<IntegrationCounts> counts(static_cast<std::size_t>(tiles_v));
  workers.run(tiles_v, [&](int tile_v) {
    const int begin = tile_v * kTile_px;
    const int end = std::min(begin + kTile_px, camera.height_px);
    std::vector<CameraBall> balls;
    std::copy_if(balls_.begin(), balls_.end(), std::back_inserter(balls),
                 [&](const CameraBall& ball) { return ball.v0 < end && ball.v1 >= begin; });
    for (int v = begin; v < end; ++v) {
      PixelRow row;
      row.x_first = static_cast<float>(-camera.cx_px / camera.fx_px);
      row.x_step = static_cast<float>(1.0 / camera.fx_px);
      const double y = (v - camera.cy_px) / camera.fy_px;
      row.y = static_cast<float>(y);
      for (int c = 0; c < 3; ++c) {
        row.start_vox[c] = static_cast<float>(start_vox[c]);
        row.across_vox[c] = static_cast<float>(rotation_vox(c, 0));
        row.along_vox[c] = static_cast<float>(rotation_vox(c, 1) * y + rotation_vox(c, 2));
      }
      add_counts(counts[static_cast<std::size_t>(tile_v)], read_row(image, v, row, balls, hits));
    }
    reduce_tiles(camera, tile_v);
  });
  farthest_m_ = 0.0F;
  for (const Bounds& tile : tiles_) farthest_m_ = std::max(farthest_m_, tile.greatest_m);
  IntegrationCounts all;
  for (const IntegrationCounts& part : counts) add_counts(all, part);
  return all;
}

IntegrationCounts CarveImage::read_row(const DepthImage& image, int v, PixelRow row,
                                       std::span<const CameraBall> balls, VoxelMarks& hits) {
  const int width = image.camera.width_px;
  const std::size_t begin = static_cast<std::size_t>(v) * static_cast<std::size_t>(width);
  const float x_first = row.x_first;
  IntegrationCounts counts;
  PixelFates fates;
  std::uint8_t self[kPixelChunk];
  for (int u = 0; u < width; u += kPixelChunk) {
    const std::size_t at = begin + static_cast<std::size_t>(u);
    row.depth_m = image.depth_m.data() + at;
    row.carve_m = carve_m_.data() + at;
    row.count = std::min(kPixelChunk, width - u);
    row.x_first = x_first + static_cast<float>(u) * row.x_step;
    row.self = mark_self(row, u, balls, self) ? self : nullptr;
    classify_pixels(row, rules_, fates);
    count_pixels(fates, row.count, counts);
    for (std::uint64_t bits = fates.insert; bits != 0; bits &= bits - 1) {
      const int i = std::countr_zero(bits);
      hits.insert(fates.voxel[0][i], fates.voxel[1][i], fates.voxel[2][i]);
    }
  }
  return counts;
}

void CarveImage::reduce_tiles(const CameraIntrinsics& camera, int tile_v) {
  const int width = camera.width_px;
  Bounds* tiles =
      tiles_.data() + static_cast<std::size_t>(tile_v) * static_cast<std::size_t>(tiles_u_);
  std::fill(tiles, tiles + tiles_u_, Bounds{INFINITY, 0.0F});
  const int first = tile_v * kTile_px;
  const int rows = std::min(kTile_px, camera.height_px - first);
  const float* values =
      carve_m_.data() + static_cast<std::size_t>(first) * static_cast<std::size_t>(width);
  for (int tile = 0; tile < tiles_u_; ++tile, values += kTile_px) {
    Bounds& bounds = tiles[tile];
    const int columns = std::min(kTile_px, width - tile * kTile_px);
    if (columns == kTile_px) {
      extremes_of_tile(values, width, rows, bounds.least_m, bounds.greatest_m);
      continue;
    }
    for (int at = 0; at < rows * columns; ++at) {
      const float free_m = std::fabs(values[at / columns * width + at % columns]);
      bounds.least_m = std::min(bounds.least_m, free_m);
      bounds.greatest_m = std::max(bounds.greatest_m, free_m);
    }
  }
}

CarveImage::Bounds CarveImage::bounds(int u0, int v0, int u1, int v1) const noexcept {
  Bounds all{INFINITY, 0.0F};
  for (int v = v0 / kTile_px; v <= v1 / kTile_px; ++v) {
    const Bounds* row =
        tiles_.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(tiles_u_);
    for (int u = u0 / kTile_px; u <= u1 / kTile_px; ++u) {
      all.least_m = std::min(all.least_m, row[u].least_m);
      all.greatest_m = std::max(all.greatest_m, row[u].greatest_m);
    }
  }
  return all;
}

void CarveImage::project_balls(const Frame& frame, const CameraIntrinsics& camera,
                               const SelfFilter& self) {
  balls_.clear();
  const Transform T_camera_world = frame.T_world_camera.inverse();
  for (const SelfFilter::Ball& ball : self.balls()) {
    const Eigen::Vector3d centre_m = T_camera_world * ball.centre_m;
    const double r = ball.radius_m;
    if (centre_m.z() + r <= 0.0) continue;
    CameraBall seen{{}, static_cast<float>(r), 0, 0, camera.width_px - 1, camera.height_px - 1};
    for (int c = 0; c < 3; ++c) seen.centre_m[c] = static_cast<float>(centre_m[c]);
    const double nearest_m = centre_m.z() - r;
    if (nearest_m > 1e-3) {
      // The image of the cube around the ball: extremes lie at its near or far face.
      const auto range = [&](double c, double focal_px, double principal_px, int last, int& low,
                             int& high) {
        const double least = (c - r) / (c - r < 0.0 ? nearest_m : centre_m.z() + r);
        const double most = (c + r) / (c + r > 0.0 ? nearest_m : centre_m.z() + r);
        low = static_cast<int>(std::clamp(std::floor(focal_px * least + principal_px), 0.0,
                                          static_cast<double>(last) + 1.0));
        high = static_cast<int>(
            std::clamp(std::ceil(focal_px * most + principal_px), -1.0, static_cast<double>(last)));
      };
      range(centre_m.x(), camera.fx_px, camera.cx_px, camera.width_px - 1, seen.u0, seen.u1);
      range(centre_m.y(), camera.fy_px, camera.cy_px, camera.height_px - 1, seen.v0, seen.v1);
    }
    if (seen.u0 <= seen.u1 && seen.v0 <= seen.v1) balls_.push_back(seen);
  }
}

}  // namespace sidestep::voxel_grid
