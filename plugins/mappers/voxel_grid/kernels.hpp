#pragma once

#include <cstdint>
#include <span>

#include "log_odds_grid.hpp"

/// The inner loops. Plain loops of fixed length over contiguous memory, compiled for several
/// instruction sets; the best one is taken when the library is loaded.
namespace sidestep::voxel_grid {

inline constexpr int kLanes = kBlockSide_vox;  ///< A row of a block is one step of a kernel.
inline constexpr int kBlockRows = kBlockSide_vox * kBlockSide_vox;

/// One block as the kernels see it.
struct BlockRows {
  std::int16_t* log_odds = nullptr;
  std::uint64_t* occupied = nullptr;  ///< Word of the block's first row.
  std::uint64_t* known = nullptr;
  std::size_t y_stride = 0;  ///< Words from one row to the next.
  std::size_t z_stride = 0;
  unsigned shift = 0;  ///< Bit of the block's first voxel in its word.
  int nx = kLanes;     ///< Voxels of the block that lie in the grid.
  int ny = kLanes;
  int nz = kLanes;
};

struct BlockOutcome {
  bool changed = false;         ///< A bit of occupied or known.
  bool saturated_free = false;  ///< Every voxel is known and at the lower clamp.
};

/// The camera over voxel indices: with c = base + i * column[0] + j * column[1] + k * column[2],
/// voxel (i, j, k) of a block has its centre at depth c[2], in pixel (c[0], c[1]) / c[2]
/// rounded down.
struct Projection {
  /// Per pixel, how far its ray is free: d > 0, the surface measured there; d < 0, free up to
  /// -d less the band, no surface; 0, nothing known.
  const float* carve_m = nullptr;
  int width_px = 0;
  float width = 0.0F;
  float height = 0.0F;
  float near_m = 0.0F;
  /// Half a voxel's edge at a depth of 1 m, along u and v: a voxel whose centre lies this near to
  /// the image may be cut by the rays of its border.
  float margin_px_m[2] = {};
  float band_m = 0.0F;
  float column[3][3] = {};
};

/// Adds a hit or a miss to each voxel that the camera sees; rows of `hits` are voxels hit by a
/// point, which win. Voxels in layers below `first_surface_layer` are hit by points only.
[[nodiscard]] BlockOutcome integrate_projected(const Projection& projection, const LogOdds& model,
                                               const BlockRows& block, const float (&base)[3],
                                               int first_surface_layer,
                                               const std::uint16_t (&hits)[kBlockRows]);

/// Adds a miss to every voxel.
[[nodiscard]] BlockOutcome integrate_free(const LogOdds& model, const BlockRows& block);

/// Adds a hit to the voxels of `hits` and a miss to those of `misses` that are not hit.
[[nodiscard]] BlockOutcome integrate_marked(const LogOdds& model, const BlockRows& block,
                                            const std::uint16_t (&hits)[kBlockRows],
                                            const std::uint16_t (&misses)[kBlockRows]);

/// How log-odds fade towards 0.
struct Fading {
  std::int32_t keep = 1 << 15;    ///< Of the log-odds, in 1 / 2^15.
  std::int16_t forget_below = 0;  ///< Magnitude at which a voxel becomes unknown.
};

/// Scales the log-odds of every known voxel.
[[nodiscard]] BlockOutcome fade(const LogOdds& model, const BlockRows& block, const Fading& fading);

inline constexpr int kPixelChunk = 64;

/// What a chunk of pixels of one row has in common.
struct PixelRow {
  const float* depth_m = nullptr;      ///< First pixel of the chunk.
  const std::uint8_t* self = nullptr;  ///< The robot's pixels; null where there are none.
  float* carve_m = nullptr;
  int count = kPixelChunk;
  float x_first = 0.0F;  ///< Ray (x, y, 1) of the first pixel, camera frame; x steps by x_step.
  float x_step = 0.0F;
  float y = 0.0F;
  // The point at depth d lies at voxel coordinates start + d * (across * x + along).
  float start_vox[3] = {};
  float across_vox[3] = {};
  float along_vox[3] = {};
};

struct PixelRules {
  float min_range_sq = 0.0F;
  float max_range_m = 0.0F;
  float floor_top_vox = 0.0F;  ///< In voxel coordinates along z.
  float band_m = 0.0F;
  bool clear_no_return = false;
  float size_vox[3] = {};
};

/// What becomes of the pixels of a chunk.
struct PixelFates {
  static constexpr int kSelf = 4;     ///< Besides those of PointFate.
  static constexpr int kOutside = 5;  ///< To be inserted, but outside the grid.
  std::uint8_t count[kOutside + 1];   ///< Of each fate; that of kInsert holds those in the grid.
  /// Pixels to be inserted, as bits, less those in the voxel of the pixel before.
  std::uint64_t insert;
  std::int32_t voxel[3][kPixelChunk];  ///< Of those.
};

/// One ball of the robot as a camera sees it.
struct CameraBall {
  float centre_m[3] = {};  ///< Camera frame.
  float radius_m = 0.0F;
  int u0 = 0, v0 = 0, u1 = 0, v1 = 0;  ///< Pixels that may see it, inclusive.
};

/// Marks the pixels of a chunk, whose first has column `u`, that lie in one of the balls: 1 there
/// and 0 elsewhere. False where there are none; then `self` may be left as it was.
[[nodiscard]] bool mark_self(const PixelRow& row, int u, std::span<const CameraBall> balls,
                             std::uint8_t (&self)[kPixelChunk]);

/// Decides what each pixel of a chunk does, and how far its ray is free.
void classify_pixels(const PixelRow& row, const PixelRules& rules, PixelFates& fates);

/// The least and the greatest magnitude of the values of a square of kTile_px pixels, `width`
/// values a row, into which those that `least` and `greatest` hold are taken up.
inline constexpr int kTile_px = 16;
void extremes_of_tile(const float* values, int width, int rows, float& least, float& greatest);

}  // namespace sidestep::voxel_grid
