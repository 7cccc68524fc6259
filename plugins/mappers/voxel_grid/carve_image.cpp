#include "carve_image.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

#include <sidestep/mapping/ray_ends.hpp>

#include "camera_view.hpp"

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
    : rules_(pixel_rules(grid, rules, clear_no_return, band_m)) {}

IntegrationCounts CarveImage::read(const Frame& frame, const DepthImage& image,
                                   const GridSpec& grid, const SelfFilter& self, VoxelMarks& hits,
                                   WorkerPool& workers) {
  const CameraIntrinsics& camera = image.camera;
  carve_m_.resize(image.depth_m.size());
  tiles_u_ = (camera.width_px + kTile_px - 1) / kTile_px;
  const int tiles_v = (camera.height_px + kTile_px - 1) / kTile_px;
  tiles_.resize(static_cast<std::size_t>(tiles_u_) * static_cast<std::size_t>(tiles_v));
  balls_ = balls_in_view(frame, camera, self);

  const PixelRays rays(frame, camera, grid);
  std::vector<IntegrationCounts> counts(static_cast<std::size_t>(tiles_v));
  workers.run(tiles_v, [&](int tile_v) {
    const int begin = tile_v * kTile_px;
    const int end = std::min(begin + kTile_px, camera.height_px);
    std::vector<CameraBall> balls;
    std::copy_if(balls_.begin(), balls_.end(), std::back_inserter(balls),
                 [&](const CameraBall& ball) { return ball.v0 < end && ball.v1 >= begin; });
    for (int v = begin; v < end; ++v) {
      add_counts(counts[static_cast<std::size_t>(tile_v)],
                 read_row(image, v, rays.row(v), balls, hits));
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

}  // namespace sidestep::voxel_grid
