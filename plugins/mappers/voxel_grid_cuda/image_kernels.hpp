#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "grid_kernels.hpp"

/// The projective integration of a depth image: the same steps, in the same order of arithmetic, as
/// in the mapper voxel_grid, so that the same voxels change.
namespace sidestep::voxel_grid_cuda {

/// What becomes of a measurement; the numbers are those of voxel_grid's PixelFates.
enum Fate { kInsert, kFloor, kOutOfRange, kInvalid, kSelf, kOutside, kFates };

/// Pixels are sorted in chunks of so many, which decides how their rays are rounded.
inline constexpr int kPixelChunk = 64;
/// Edge of the squares over which the image's least and greatest depth are kept.
inline constexpr int kImageTile = 16;

/// What the pixels of an image row have in common: ray (x, y, 1) and where it goes in the grid.
struct PixelLine {
  float y = 0.0F;
  float along_vox[3] = {};
};

/// One ball of the robot as the camera sees it.
struct Ball {
  float centre_m[3] = {};
  float radius_m = 0.0F;
  int u0 = 0, v0 = 0, u1 = 0, v1 = 0;  ///< Pixels that may see it, inclusive.
};

struct PixelRules {
  float min_range_sq = 0.0F;
  float max_range_m = 0.0F;
  float floor_top_vox = 0.0F;
  float band_m = 0.0F;
  bool clear_no_return = false;
};

/// The camera over voxel indices; as voxel_grid's Projection and what blocks are judged by.
struct View {
  int width_px = 0;
  int height_px = 0;
  double near_m = 0.0;
  float margin_px_m[2] = {};
  float band_m = 0.0F;
  float depth_slack_m = 0.0F;
  int pixel_slack = 0;
  int first_surface_layer = 0;
  double base[3] = {};        ///< Of voxel (0, 0, 0).
  double columns[3][3] = {};  ///< [axis][component], per voxel.
};

SIDESTEP_HOST_DEVICE inline float magnitude(float a) { return a < 0.0F ? -a : a; }
SIDESTEP_HOST_DEVICE inline double magnitude(double a) { return a < 0.0 ? -a : a; }

/// The bits of a number that is not negative are ordered as it is.
SIDESTEP_HOST_DEVICE inline int ordered_bits(float a) {
#if defined(__CUDA_ARCH__)
  return __float_as_int(a);
#else
  return std::bit_cast<int>(a);
#endif
}
SIDESTEP_HOST_DEVICE inline float from_ordered_bits(int bits) {
#if defined(__CUDA_ARCH__)
  return __int_as_float(bits);
#else
  return std::bit_cast<float>(bits);
#endif
}

/// Decides what each pixel does, marks the voxels of points, and how far each ray is free.
struct ClassifyPixels {
  static constexpr int kThreads = 256;
  static constexpr int kPhases = 3;
  struct Shared {
    std::uint32_t counts[kFates];
  };

  Grid grid;
  Marks hits;
  PixelRules rules;
  int width = 0;
  int height = 0;
  float x_first = 0.0F;
  float x_step = 0.0F;
  float start_vox[3] = {};
  float across_vox[3] = {};
  const PixelLine* lines = nullptr;
  const Ball* balls = nullptr;
  int ball_count = 0;
  const float* depth_m = nullptr;
  float* carve_m = nullptr;
  std::uint32_t* counts = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared& shared) const {
    if constexpr (kPhase == 0) {
      if (thread < kFates) shared.counts[thread] = 0;
    } else if constexpr (kPhase == 1) {
      const std::int64_t pixel = block * kThreads + thread;
      if (pixel >= std::int64_t{width} * height) return;
      cuda::add_to(shared.counts[classify(static_cast<int>(pixel))], 1u);
    } else {
      if (thread < kFates && shared.counts[thread] != 0) {
        cuda::add_to(counts[thread], shared.counts[thread]);
      }
    }
  }

 private:
  SIDESTEP_HOST_DEVICE Fate classify(int pixel) const {
    const int u = pixel % width;
    const int v = pixel / width;
    const int chunk = u / kPixelChunk * kPixelChunk;
    const PixelLine line = lines[v];
    const float d = depth_m[pixel];
    const float chunk_x = x_first + static_cast<float>(chunk) * x_step;
    const float x = chunk_x + static_cast<float>(u - chunk) * x_step;
    if (ball_count > 0 && is_self(v, chunk, d, x, line.y)) {
      carve_m[pixel] = 0.0F;
      return kSelf;
    }
    const float ray_sq = 1.0F + x * x + line.y * line.y;
    const float range_sq = d * d * ray_sq;
    const float farthest_m = rules.max_range_m / sqrtf(ray_sq);
    const bool valid = d > 0.0F && d <= cuda::kLargestF && range_sq > rules.min_range_sq;
    if (!valid) {
      const bool cleared = d == 0.0F && rules.clear_no_return;
      carve_m[pixel] = cleared ? -(farthest_m + rules.band_m) : 0.0F;
      return kInvalid;
    }
    const bool far = range_sq > rules.max_range_m * rules.max_range_m;
    const float along_m = far ? farthest_m : d;
    float p_vox[3];
    for (int c = 0; c < 3; ++c) {
      p_vox[c] = start_vox[c] + along_m * (across_vox[c] * x + line.along_vox[c]);
    }
    const bool low = p_vox[2] < rules.floor_top_vox;
    carve_m[pixel] = far || low ? -(along_m + rules.band_m) : d;
    if (far) return kOutOfRange;
    if (low) return kFloor;
    const bool inside = p_vox[0] >= 0.0F && p_vox[0] < static_cast<float>(grid.size.x) &&
                        p_vox[1] >= 0.0F && p_vox[1] < static_cast<float>(grid.size.y) &&
                        p_vox[2] >= 0.0F && p_vox[2] < static_cast<float>(grid.size.z);
    if (!inside) return kOutside;
    const int i = static_cast<int>(p_vox[0]);
    const int j = static_cast<int>(p_vox[1]);
    const int k = static_cast<int>(p_vox[2]);
    hits.insert(grid.block_of(i, j, k), i, j, k);
    return kInsert;
  }

  /// Balls are sorted out by chunks of pixels and rows of tiles.
  [[nodiscard]] SIDESTEP_HOST_DEVICE bool is_self(int v, int chunk, float d, float x,
                                                  float y) const {
    if (!(d > 0.0F)) return false;
    const int begin = v / kImageTile * kImageTile;
    const int end = cuda::least_of(begin + kImageTile, height);
    for (int b = 0; b < ball_count; ++b) {
      const Ball& ball = balls[b];
      if (ball.v0 >= end || ball.v1 < begin) continue;
      if (ball.u1 < chunk || ball.u0 >= chunk + kPixelChunk) continue;
      const float dx = d * x - ball.centre_m[0];
      const float dy = d * y - ball.centre_m[1];
      const float dz = d - ball.centre_m[2];
      if (dx * dx + dy * dy + dz * dz <= ball.radius_m * ball.radius_m) return true;
    }
    return false;
  }
};

/// The least and the greatest length that rays are free over a tile of pixels.
struct Bounds {
  float least_m;
  float greatest_m;
};

/// Bounds of every tile, a block of threads a tile.
struct ReduceTiles {
  static constexpr int kThreads = kImageTile * kImageTile;
  static constexpr int kPhases = 3;
  struct Shared {
    int least, greatest;
  };

  int width = 0;
  int height = 0;
  int tiles_u = 0;
  const float* carve_m = nullptr;
  Bounds* tiles = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t tile, int thread, Shared& shared) const {
    const int none = ordered_bits(cuda::kInfinityF);
    if constexpr (kPhase == 0) {
      if (thread != 0) return;
      shared.least = none;
      shared.greatest = 0;
    } else if constexpr (kPhase == 1) {
      const int u = static_cast<int>(tile % tiles_u) * kImageTile + thread % kImageTile;
      const int v = static_cast<int>(tile / tiles_u) * kImageTile + thread / kImageTile;
      const bool is_inside = u < width && v < height;
      const int bits = is_inside ? ordered_bits(magnitude(carve_m[u + width * v])) : 0;
      cuda::lower_to_warps(shared.least, is_inside ? bits : none);
      cuda::raise_to_warps(shared.greatest, bits);
    } else if (thread == 0) {
      tiles[tile] = {from_ordered_bits(shared.least), from_ordered_bits(shared.greatest)};
    }
  }
};

/// Adds a hit or a miss to each voxel that the camera sees: a block of threads a block of voxels, a
/// thread a row. Blocks behind the surface are left alone, and free ones that are settled.
struct IntegrateImage {
  static constexpr int kThreads = cuda::kBlockRows;
  static constexpr int kPhases = 5;
  enum Action { kLeave, kClear, kCompare };
  struct Shared {
    int in_view;         ///< Whether the camera may see the block, or has hits in it.
    int action;          ///< From phase 2 on; nobody reads it in the phase that writes it.
    int u0, v0, u1, v1;  ///< Pixels that the block may cover.
    int whole;           ///< Whether every voxel of it is in the image.
    int has_hits;
    double depth_least, depth_greatest;
    int free_least, free_greatest;
    float first[3];
    int changed, settled;
  };

  Grid grid;
  Marks hits;
  View view;
  int tiles_u = 0;
  const float* carve_m = nullptr;
  const Bounds* tiles = nullptr;

  template <int kPhase>
  SIDESTEP_HOST_DEVICE void run(std::int64_t block, int thread, Shared& shared) const {
    if constexpr (kPhase == 0) {
      if (thread == 0) look(block, shared);
    } else if constexpr (kPhase == 1) {
      if (shared.in_view != 0) bound(thread, shared);
    } else if constexpr (kPhase == 2) {
      if (thread == 0) decide(block, shared);
    } else if (shared.action == kLeave) {
      return;
    } else if constexpr (kPhase == 3) {
      integrate(block, thread, shared);
    } else {
      finish(block, thread, shared);
    }
  }

 private:
  struct Interval {
    double least, greatest;
  };
  /// Least and greatest of n . (U, V, Z) over the voxel centres of a block.
  [[nodiscard]] SIDESTEP_HOST_DEVICE Interval over_block(const double (&centre)[3], double nu,
                                                         double nv, double nz) const {
    const double middle = nu * centre[0] + nv * centre[1] + nz * centre[2];
    double reach = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double(&column)[3] = view.columns[axis];
      reach += magnitude(nu * column[0] + nv * column[1] + nz * column[2]);
    }
    reach *= 0.5 * (cuda::kBlockSide - 1);
    return {middle - reach, middle + reach};
  }

  /// Where the block lies in the image, and whether it may be seen at all.
  SIDESTEP_HOST_DEVICE void look(std::int64_t block, Shared& shared) const {
    const cuda::Extent at = grid.first_voxel(block);
    const double x = at.x, y = at.y, z = at.z;
    double first[3], centre[3];
    for (int c = 0; c < 3; ++c) {
      first[c] = view.base[c] +
                 ((view.columns[0][c] * x + view.columns[1][c] * y) + view.columns[2][c] * z);
      centre[c] = first[c] + 0.5 * (cuda::kBlockSide - 1) *
                                 (view.columns[0][c] + view.columns[1][c] + view.columns[2][c]);
      shared.first[c] = static_cast<float>(first[c]);
    }
    shared.has_hits = hits.blocks[block];
    const Interval depth = over_block(centre, 0.0, 0.0, 1.0);
    shared.depth_least = depth.least;
    shared.depth_greatest = depth.greatest;
    shared.in_view = shared.has_hits != 0 || is_in_view(centre, depth) ? 1 : 0;
    shared.u0 = shared.v0 = 0;
    shared.u1 = view.width_px - 1;
    shared.v1 = view.height_px - 1;
    shared.whole = 0;
    if (depth.least > view.near_m) cover(first, shared);
    shared.free_least = ordered_bits(cuda::kInfinityF);
    shared.free_greatest = 0;
    shared.changed = 0;
    shared.settled = 1;
  }

  [[nodiscard]] SIDESTEP_HOST_DEVICE bool is_in_view(const double (&centre)[3],
                                                     const Interval& depth) const {
    const double margin_u = static_cast<double>(view.margin_px_m[0]);
    const double margin_v = static_cast<double>(view.margin_px_m[1]);
    return !(depth.greatest < view.near_m ||
             over_block(centre, 1.0, 0.0, 0.0).greatest < -margin_u ||
             over_block(centre, 0.0, 1.0, 0.0).greatest < -margin_v ||
             over_block(centre, -1.0, 0.0, view.width_px).greatest < -margin_u ||
             over_block(centre, 0.0, -1.0, view.height_px).greatest < -margin_v);
  }

  /// The pixels around a block that is wholly in front of the camera.
  SIDESTEP_HOST_DEVICE void cover(const double (&first)[3], Shared& shared) const {
    double lower[2] = {cuda::kInfinity, cuda::kInfinity};
    double upper[2] = {-lower[0], -lower[1]};
    for (int corner = 0; corner < 8; ++corner) {
      double c[3];
      for (int i = 0; i < 3; ++i) {
        c[i] = first[i];
        for (int axis = 0; axis < 3; ++axis) {
          if (((corner >> axis) & 1) != 0) c[i] += (cuda::kBlockSide - 1) * view.columns[axis][i];
        }
      }
      for (int i = 0; i < 2; ++i) {
        lower[i] = cuda::least_of(lower[i], c[i] / c[2]);
        upper[i] = cuda::most_of(upper[i], c[i] / c[2]);
      }
    }
    const double size[2] = {static_cast<double>(view.width_px),
                            static_cast<double>(view.height_px)};
    bool whole = true;
    int low[2], high[2];
    for (int i = 0; i < 2; ++i) {
      whole = whole && lower[i] >= view.pixel_slack && upper[i] < size[i] - view.pixel_slack;
      low[i] = static_cast<int>(
          cuda::least_of(cuda::most_of(lower[i] - view.pixel_slack, 0.0), size[i] - 1.0));
      high[i] = static_cast<int>(
          cuda::least_of(cuda::most_of(upper[i] + view.pixel_slack, 0.0), size[i] - 1.0));
    }
    shared.whole = whole ? 1 : 0;
    shared.u0 = low[0];
    shared.v0 = low[1];
    shared.u1 = high[0];
    shared.v1 = high[1];
  }

  /// How far rays are free over the tiles that hold the block's pixels.
  SIDESTEP_HOST_DEVICE void bound(int thread, Shared& shared) const {
    const int first_u = shared.u0 / kImageTile;
    const int first_v = shared.v0 / kImageTile;
    const int wide = shared.u1 / kImageTile - first_u + 1;
    const int count = wide * (shared.v1 / kImageTile - first_v + 1);
    for (int i = thread; i < count; i += kThreads) {
      const Bounds tile = tiles[first_u + i % wide + tiles_u * (first_v + i / wide)];
      cuda::lower_to(shared.free_least, ordered_bits(tile.least_m));
      cuda::raise_to(shared.free_greatest, ordered_bits(tile.greatest_m));
    }
  }

  SIDESTEP_HOST_DEVICE void decide(std::int64_t block, Shared& shared) const {
    shared.action = shared.in_view != 0 ? kCompare : kLeave;
    if (shared.in_view == 0 || shared.has_hits != 0) return;
    const float beyond_m =
        from_ordered_bits(shared.free_greatest) + view.band_m + view.depth_slack_m;
    const float before_m = from_ordered_bits(shared.free_least) - view.band_m - view.depth_slack_m;
    if (shared.depth_least > static_cast<double>(beyond_m)) {
      shared.action = kLeave;
    } else if (shared.whole != 0 && shared.depth_greatest < static_cast<double>(before_m)) {
      shared.action = grid.settled[block] != 0 ? kLeave : kClear;
    }
  }

  SIDESTEP_HOST_DEVICE void integrate(std::int64_t block, int row, Shared& shared) const {
    const cuda::Extent first = grid.first_voxel(block);
    if (!grid.has_row(first, row)) return;
    RowChange change;
    if (shared.action == kClear) {
      for (std::int16_t& delta : change.delta) delta = grid.model.miss;
    } else {
      compare(first, row, shared, hits.row(block, row), change);
    }
    const RowOutcome outcome =
        add_row(grid, block, row, cuda::least_of(cuda::kBlockSide, grid.size.x - first.x), change);
    if (outcome.changed) cuda::raise_to(shared.changed, 1);
    if (!outcome.settled) cuda::lower_to(shared.settled, 0);
  }

  /// Hit, miss or nothing for the voxels of a row, by comparing their depth with the image.
  SIDESTEP_HOST_DEVICE void compare(const cuda::Extent& first, int row, const Shared& shared,
                                    std::uint32_t hit, RowChange& change) const {
    constexpr int kSide = cuda::kBlockSide;
    float column[3][3];
    for (int axis = 0; axis < 3; ++axis) {
      for (int c = 0; c < 3; ++c) column[axis][c] = static_cast<float>(view.columns[axis][c]);
    }
    const int y = row % kSide;
    const int z = row / kSide;
    float start[3];
    for (int c = 0; c < 3; ++c) {
      start[c] = shared.first[c] + static_cast<float>(y) * column[1][c] +
                 static_cast<float>(z) * column[2][c];
    }
    const bool has_surface = z >= view.first_surface_layer - first.z;
    for (int i = 0; i < kSide; ++i) {
      const auto step = static_cast<float>(i);
      const float seen[3] = {start[0] + step * column[0][0], start[1] + step * column[0][1],
                             start[2] + step * column[0][2]};
      change.delta[i] = ((hit >> i) & 1u) != 0 ? grid.model.hit : judge(seen, has_surface);
    }
  }

  /// One voxel, at seen[2] before the camera in pixel (seen[0], seen[1]) / seen[2].
  [[nodiscard]] SIDESTEP_HOST_DEVICE std::int16_t judge(const float (&seen)[3],
                                                        bool has_surface) const {
    const float depth = seen[2];
    if (!(depth > static_cast<float>(view.near_m))) return 0;
    const auto width = static_cast<float>(view.width_px);
    const auto height = static_cast<float>(view.height_px);
    const float inverse = 1.0F / depth;
    const float u = seen[0] * inverse;
    const float v = seen[1] * inverse;
    const float margin_u = view.margin_px_m[0] * inverse;
    const float margin_v = view.margin_px_m[1] * inverse;
    const bool is_in = u >= 0.0F && u < width && v >= 0.0F && v < height;
    const bool is_cut =
        u >= -margin_u && u < width + margin_u && v >= -margin_v && v < height + margin_v;
    if (!is_in && !is_cut) return 0;
    const int pixel_u = static_cast<int>(cuda::least_of(cuda::most_of(0.0F, u), width - 1.0F));
    const int pixel_v = static_cast<int>(cuda::least_of(cuda::most_of(0.0F, v), height - 1.0F));
    const float carve = carve_m[pixel_v * view.width_px + pixel_u];
    const float gap = magnitude(carve) - depth;
    if (is_cut && gap > view.band_m) return grid.model.miss;
    const bool is_surface = carve > 0.0F && magnitude(gap) <= view.band_m;
    return is_in && is_surface && has_surface ? grid.model.hit : std::int16_t{0};
  }

  SIDESTEP_HOST_DEVICE void finish(std::int64_t block, int thread, const Shared& shared) const {
    if (shared.has_hits != 0 && thread % 2 == 0) hits.clear_pair(block, thread);
    if (thread != 0) return;
    hits.blocks[block] = 0;
    if (shared.changed != 0) grid.changed[block] = 1;
    grid.settled[block] = shared.action == kClear && shared.settled != 0 ? 1 : 0;
  }
};

}  // namespace sidestep::voxel_grid_cuda
