#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "grid_kernels.hpp"

/// What projective integration makes of a depth image before voxels are looked at: the same steps,
/// in the same order of arithmetic, as in the mapper voxel_grid, so that the same voxels change.
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

}  // namespace sidestep::voxel_grid_cuda
