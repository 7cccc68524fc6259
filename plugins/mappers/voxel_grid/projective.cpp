#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>

#include "camera_view.hpp"
#include "integrators.hpp"

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

struct ProjectiveIntegrator::View : GridView {
  int width_px;
  int height_px;
  double stamp_s;
  BlockRange range;

  /// Least and greatest value of n . (U, V, Z) over the voxel centres of a block.
  struct Interval {
    double least;
    double greatest;
  };
  [[nodiscard]] Interval over_block(const Eigen::Vector3d& centre, double half,
                                    const Eigen::RowVector3d& n) const {
    const double middle = n * centre;
    const double reach = half * (n * columns).cwiseAbs().sum();
    return {middle - reach, middle + reach};
  }
};

ProjectiveIntegrator::ProjectiveIntegrator(const VoxelGridOptions& options, LogOddsGrid& map,
                                           VoxelMarks& hits, WorkerPool& workers)
    : map_(map),
      hits_(hits),
      workers_(workers),
      image_(options.grid(), options.rules(), options.clear_no_return, voxel_grid::band_m(options)),
      band_m_(voxel_grid::band_m(options)),
      first_surface_layer_(first_surface_layer(options)) {}

IntegrationCounts ProjectiveIntegrator::integrate(const Frame& frame, const DepthImage& image,
                                                  const SelfFilter& self) {
  const IntegrationCounts counts = image_.read(frame, image, map_.spec(), self, hits_, workers_);
  const View view = view_of(frame, image.camera);
  const Eigen::Vector3i extent = view.range.last - view.range.first + Eigen::Vector3i::Ones();
  if ((extent.array() <= 0).any()) return counts;
  workers_.run(extent.y() * extent.z(), [&](int row) {
    Eigen::Vector3i block(0, view.range.first.y() + row % extent.y(),
                          view.range.first.z() + row / extent.y());
    for (block.x() = view.range.first.x(); block.x() <= view.range.last.x(); ++block.x()) {
      visit(view, block);
    }
  });
  return counts;
}

ProjectiveIntegrator::View ProjectiveIntegrator::view_of(const Frame& frame,
                                                         const CameraIntrinsics& camera) const {
  const GridSpec& grid = map_.spec();
  View view{view_of_grid(frame, camera, grid, band_m_)};
  view.projection.carve_m = image_.carve_m();
  view.width_px = camera.width_px;
  view.height_px = camera.height_px;
  view.stamp_s = frame.stamp.seconds();
  view.range = blocks_in_view(frame, camera);
  return view;
}

ProjectiveIntegrator::BlockRange ProjectiveIntegrator::blocks_in_view(
    const Frame& frame, const CameraIntrinsics& camera) const {
  const GridSpec& grid = map_.spec();
  const double far_m = image_.farthest_m() + 2.0 * band_m_ + grid.resolution_m;
  Eigen::Vector3d lower = frame.T_world_camera.translation();
  Eigen::Vector3d upper = lower;
  for (const double u : {-1.0, static_cast<double>(camera.width_px)}) {
    for (const double v : {-1.0, static_cast<double>(camera.height_px)}) {
      const Eigen::Vector3d corner = frame.T_world_camera * camera.unproject(u, v, far_m);
      lower = lower.cwiseMin(corner);
      upper = upper.cwiseMax(corner);
    }
  }
  const double block_m = grid.resolution_m * kBlockSide_vox;
  const auto clamped = [&](const Eigen::Vector3d& p, double low, const Eigen::Vector3i& high) {
    const Eigen::Vector3d block = ((p - grid.origin_m) / block_m).array().floor();
    return Eigen::Vector3i(block.cwiseMax(low).cwiseMin(high.cast<double>()).cast<int>());
  };
  const Eigen::Vector3d slack = Eigen::Vector3d::Constant(grid.resolution_m);
  // Clamped to one beyond the grid on either side, so that what misses it stays empty.
  return {clamped(lower - slack, -1.0, map_.counts()).cwiseMax(0),
          clamped(upper + slack, -1.0, map_.counts())
              .cwiseMin(map_.counts() - Eigen::Vector3i::Ones())};
}

void ProjectiveIntegrator::visit(const View& view, const Eigen::Vector3i& block) {
  constexpr double kHalf = 0.5 * (kBlockSide_vox - 1);
  const std::int32_t linear = block_linear(block, map_.counts());
  const bool hit = hits_.in_block(linear);
  const Eigen::Vector3d first = view.first(block);
  const Eigen::Vector3d centre = first + view.columns * Eigen::Vector3d::Constant(kHalf);
  const auto over = [&](double u, double v, double z) {
    return view.over_block(centre, kHalf, {u, v, z});
  };
  const auto depth = over(0, 0, 1);
  const auto out_of_view = [&] {
    const double margin_u = static_cast<double>(view.projection.margin_px_m[0]);
    const double margin_v = static_cast<double>(view.projection.margin_px_m[1]);
    return depth.greatest < kNear_m || over(1, 0, 0).greatest < -margin_u ||
           over(0, 1, 0).greatest < -margin_v || over(-1, 0, view.width_px).greatest < -margin_u ||
           over(0, -1, view.height_px).greatest < -margin_v;
  };
  if (!hit && out_of_view()) return;

  int u0 = 0, v0 = 0, u1 = view.width_px - 1, v1 = view.height_px - 1;
  bool whole = false;  // every voxel of the block is in the image
  if (depth.least > kNear_m) {
    Eigen::Array2d lower(INFINITY, INFINITY);
    Eigen::Array2d upper(-INFINITY, -INFINITY);
    for (int corner = 0; corner < 8; ++corner) {
      const Eigen::Vector3d offset(corner & 1, (corner >> 1) & 1, corner >> 2);
      const Eigen::Vector3d c = first + view.columns * offset * (kBlockSide_vox - 1);
      lower = lower.min(c.head<2>().array() / c.z());
      upper = upper.max(c.head<2>().array() / c.z());
    }
    const Eigen::Array2d size(view.width_px, view.height_px);
    whole = (lower >= kPixelSlack).all() && (upper < size - kPixelSlack).all();
    lower = (lower - kPixelSlack).max(0.0).min(size - 1.0);
    upper = (upper + kPixelSlack).max(0.0).min(size - 1.0);
    u0 = static_cast<int>(lower.x());
    v0 = static_cast<int>(lower.y());
    u1 = static_cast<int>(upper.x());
    v1 = static_cast<int>(upper.y());
  }
  const CarveImage::Bounds free_m = image_.bounds(u0, v0, u1, v1);
  if (!hit && depth.least > static_cast<double>(free_m.greatest_m + band_m_ + kDepthSlack_m))
    return;

  const bool free = !hit && whole &&
                    depth.greatest < static_cast<double>(free_m.least_m - band_m_ - kDepthSlack_m);
  if (free && map_.saturated_free(linear) != 0) {
    map_.last_update_s(linear) = view.stamp_s;
    return;
  }
  const BlockRows rows = block_rows(map_, block);
  if (free) {
    note(map_, block, view.stamp_s, integrate_free(map_.model(), rows));
    return;
  }
  std::uint16_t hits[kBlockRows];
  take_marks(hits_, map_, block, rows, hits);
  const float base[3] = {static_cast<float>(first.x()), static_cast<float>(first.y()),
                         static_cast<float>(first.z())};
  note(map_, block, view.stamp_s,
       integrate_projected(view.projection, map_.model(), rows, base,
                           first_surface_layer_ - block.z() * kBlockSide_vox, hits));
}

}  // namespace sidestep::voxel_grid
