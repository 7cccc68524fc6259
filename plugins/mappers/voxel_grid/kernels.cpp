#include "kernels.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include <sidestep/core/lanes.hpp>
#include <sidestep/mapping/point_rules.hpp>

namespace sidestep::voxel_grid {
// Clones have internal linkage, or their resolvers would be visible symbols of the plugin.
namespace {

SIDESTEP_INLINE float magnitude(float a) { return __builtin_fabsf(a); }

/// Bit i of the result is lane i; lanes are 0 or 1.
SIDESTEP_INLINE std::uint32_t pack(const std::uint8_t (&lanes)[kLanes]) {
  std::uint64_t low;
  std::uint64_t high;
  std::memcpy(&low, lanes, 8);
  std::memcpy(&high, lanes + 8, 8);
  // The product gathers byte i's lowest bit at bit 56 + i; no two terms meet, so no carries.
  constexpr std::uint64_t kGather = 0x0102040810204080U;
  return static_cast<std::uint32_t>((low * kGather) >> 56) |
         (static_cast<std::uint32_t>((high * kGather) >> 56) << 8);
}

/// A row of log-odds, on which operators work lane by lane; a comparison is all ones where it
/// holds. A vector extension of GCC and Clang: g++ 12 makes branches of plain loops over narrow
/// integers.
using Row = std::int16_t __attribute__((vector_size(2 * kLanes), aligned(2), may_alias));
static_assert(sizeof(Row) == kLanes * sizeof(std::int16_t));

SIDESTEP_INLINE const Row& as_row(const std::int16_t* lanes) {
  return *reinterpret_cast<const Row*>(lanes);
}
SIDESTEP_INLINE Row& as_row(std::int16_t* lanes) { return *reinterpret_cast<Row*>(lanes); }

/// Bit i of the result is lane i of a comparison.
SIDESTEP_INLINE std::uint32_t bits_of(const Row& comparison) {
  using Bytes = std::int8_t __attribute__((vector_size(kLanes)));
  const Bytes ones = __builtin_convertvector(comparison, Bytes) & 1;
  std::uint8_t lanes[kLanes];
  std::memcpy(lanes, &ones, kLanes);
  return pack(lanes);
}

/// Adds `delta` to a row, clamps, and brings its bits up to date; 0 leaves a voxel as it is.
SIDESTEP_INLINE bool add_row(LogOdds model, const std::int16_t (&delta)[kLanes],
                             std::int16_t* log_odds, std::uint64_t& occupied, std::uint64_t& known,
                             unsigned shift) {
  const Row added = as_row(delta);
  const Row least = Row{} + model.min;
  const Row most = Row{} + model.max;
  const Row sum = as_row(log_odds) + added;
  const Row raised = sum < least ? least : sum;
  const Row clamped = raised > most ? most : raised;
  as_row(log_odds) = clamped;
  const std::uint64_t known_before = (known >> shift) & 0xffffU;
  const std::uint64_t occupied_before = (occupied >> shift) & 0xffffU;
  const std::uint64_t known_after = known_before | bits_of(added != 0);
  const std::uint64_t occupied_after = known_after & bits_of(clamped >= model.occupied_at);
  known |= known_after << shift;
  occupied ^= (occupied_before ^ occupied_after) << shift;
  return known_before != known_after || occupied_before != occupied_after;
}

SIDESTEP_INLINE std::size_t word_of(const BlockRows& block, int y, int z) {
  return static_cast<std::size_t>(y) * block.y_stride +
         static_cast<std::size_t>(z) * block.z_stride;
}

SIDESTEP_INLINE std::int16_t* row_of(const BlockRows& block, int y, int z) {
  return block.log_odds + kLanes * (y + kLanes * z);
}

/// Lanes outside the grid stay as they are.
SIDESTEP_INLINE void cut(std::int16_t (&delta)[kLanes], int nx) {
  for (int i = nx; i < kLanes; ++i) delta[i] = 0;
}

SIDESTEP_INLINE void select(std::uint32_t bits, std::int16_t chosen,
                            std::int16_t (&delta)[kLanes]) {
  if (bits == 0) return;
  constexpr Row kBit = {1 << 0, 1 << 1, 1 << 2,  1 << 3,  1 << 4,  1 << 5,  1 << 6,  1 << 7,
                        1 << 8, 1 << 9, 1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 14, -32768};
  const Row is_chosen = ((Row{} + static_cast<std::int16_t>(bits)) & kBit) != 0;
  as_row(delta) = is_chosen ? (Row{} + chosen) : as_row(delta);
}

/// Hit, miss or nothing for the 16 voxels of a row, by comparing their depth with the image; those
/// just outside it, with its border.
SIDESTEP_INLINE void compare_row(const Projection& p, const float (&first)[3], std::int32_t hit,
                                 std::int32_t miss, std::int16_t (&delta)[kLanes]) {
  float depth[kLanes];
  std::int32_t pixel[kLanes];
  std::int32_t seen[kLanes];  // all ones or zero: masks, for no branch ever becomes SIMD
  std::int32_t cut[kLanes];
  const float last_u = p.width - 1.0F;
  const float last_v = p.height - 1.0F;
  for (int i = 0; i < kLanes; ++i) {
    const auto step = static_cast<float>(i);
    const float z = first[2] + step * p.column[0][2];
    const float inverse = 1.0F / z;
    const float u = (first[0] + step * p.column[0][0]) * inverse;
    const float v = (first[1] + step * p.column[0][1]) * inverse;
    const float margin_u = p.margin_px_m[0] * inverse;
    const float margin_v = p.margin_px_m[1] * inverse;
    const bool ahead = z > p.near_m;
    seen[i] = -static_cast<std::int32_t>(ahead & (u >= 0.0F) & (u < p.width) & (v >= 0.0F) &
                                         (v < p.height));
    cut[i] = -static_cast<std::int32_t>(ahead & (u >= -margin_u) & (u < p.width + margin_u) &
                                        (v >= -margin_v) & (v < p.height + margin_v));
    // In this order, NaN becomes 0.
    const auto column = static_cast<std::int32_t>(lesser(greater(0.0F, u), last_u));
    const auto row = static_cast<std::int32_t>(lesser(greater(0.0F, v), last_v));
    pixel[i] = row * p.width_px + column;
    depth[i] = z;
  }
  std::int32_t change[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    const float carve = p.carve_m[pixel[i]];
    const float gap = magnitude(carve) - depth[i];
    const std::int32_t free = -static_cast<std::int32_t>(gap > p.band_m);
    const std::int32_t surface =
        -static_cast<std::int32_t>((carve > 0.0F) & (magnitude(gap) <= p.band_m));
    change[i] = (cut[i] & free & miss) | (seen[i] & surface & hit);
  }
  for (int i = 0; i < kLanes; ++i) delta[i] = static_cast<std::int16_t>(change[i]);
}

SIDESTEP_SIMD_CLONES
BlockOutcome projected(const Projection& projection, const LogOdds& model, const BlockRows& block,
                       const float (&base)[3], int first_surface_layer,
                       const std::uint16_t (&hits)[kBlockRows]) {
  bool changed = false;
  for (int z = 0; z < block.nz; ++z) {
    const std::int16_t surface_hit = z >= first_surface_layer ? model.hit : std::int16_t{0};
    for (int y = 0; y < block.ny; ++y) {
      float first[3];
      for (int c = 0; c < 3; ++c) {
        first[c] = base[c] + static_cast<float>(y) * projection.column[1][c] +
                   static_cast<float>(z) * projection.column[2][c];
      }
      alignas(64) std::int16_t delta[kLanes];
      compare_row(projection, first, surface_hit, model.miss, delta);
      select(hits[y + kLanes * z], model.hit, delta);
      if (block.nx < kLanes) cut(delta, block.nx);
      const std::size_t word = word_of(block, y, z);
      changed |= add_row(model, delta, row_of(block, y, z), block.occupied[word], block.known[word],
                         block.shift);
    }
  }
  return {changed, false};
}

SIDESTEP_SIMD_CLONES
BlockOutcome free_block(const LogOdds& model, const BlockRows& block) {
  alignas(64) std::int16_t delta[kLanes];
  for (int i = 0; i < kLanes; ++i) delta[i] = i < block.nx ? model.miss : std::int16_t{0};
  bool changed = false;
  Row unsettled{};
  for (int z = 0; z < block.nz; ++z) {
    for (int y = 0; y < block.ny; ++y) {
      std::int16_t* log_odds = row_of(block, y, z);
      const std::size_t word = word_of(block, y, z);
      changed |=
          add_row(model, delta, log_odds, block.occupied[word], block.known[word], block.shift);
      unsettled |= (as_row(delta) != 0) & (as_row(log_odds) != model.min);
    }
  }
  return {changed, bits_of(unsettled) == 0};
}

SIDESTEP_SIMD_CLONES
BlockOutcome marked(const LogOdds& model, const BlockRows& block,
                    const std::uint16_t (&hits)[kBlockRows],
                    const std::uint16_t (&misses)[kBlockRows]) {
  bool changed = false;
  for (int z = 0; z < block.nz; ++z) {
    for (int y = 0; y < block.ny; ++y) {
      const std::uint32_t hit = hits[y + kLanes * z];
      const std::uint32_t miss = misses[y + kLanes * z];
      if ((hit | miss) == 0) continue;
      alignas(64) std::int16_t delta[kLanes] = {};
      select(miss, model.miss, delta);
      select(hit, model.hit, delta);
      const std::size_t word = word_of(block, y, z);
      changed |= add_row(model, delta, row_of(block, y, z), block.occupied[word], block.known[word],
                         block.shift);
    }
  }
  return {changed, false};
}

SIDESTEP_SIMD_CLONES
BlockOutcome fade_block(const LogOdds& model, const BlockRows& block, const Fading& fading) {
  bool changed = false;
  for (int z = 0; z < block.nz; ++z) {
    for (int y = 0; y < block.ny; ++y) {
      const std::size_t word = word_of(block, y, z);
      const std::uint64_t known = (block.known[word] >> block.shift) & 0xffffU;
      if (known == 0) continue;
      std::int16_t* log_odds = row_of(block, y, z);
      std::uint8_t kept[kLanes];
      std::uint8_t high[kLanes];
      for (int i = 0; i < kLanes; ++i) {
        const std::int32_t scaled = log_odds[i] * fading.keep / (1 << 15);
        const bool keeps = (scaled >= fading.forget_below) | (scaled <= -fading.forget_below);
        const std::int32_t faded = keeps ? scaled : 0;
        log_odds[i] = static_cast<std::int16_t>(faded);
        kept[i] = keeps;
        high[i] = faded >= model.occupied_at;
      }
      const std::uint64_t known_after = known & pack(kept);
      const std::uint64_t occupied = (block.occupied[word] >> block.shift) & 0xffffU;
      const std::uint64_t occupied_after = known_after & pack(high);
      block.known[word] ^= (known ^ known_after) << block.shift;
      block.occupied[word] ^= (occupied ^ occupied_after) << block.shift;
      changed |= known != known_after || occupied != occupied_after;
    }
  }
  return {changed, false};
}

/// Bit i of the result is pixel i; pixels are 0 or 1.
SIDESTEP_INLINE std::uint64_t pack_pixels(const std::uint8_t (&pixels)[kPixelChunk]) {
  std::uint64_t bits = 0;
  for (int part = 0; part < kPixelChunk; part += kLanes) {
    std::uint8_t lanes[kLanes];
    std::memcpy(lanes, pixels + part, kLanes);
    bits |= std::uint64_t{pack(lanes)} << part;
  }
  return bits;
}

SIDESTEP_SIMD_CLONES
bool mark(const PixelRow& row, int u, std::span<const CameraBall> balls,
          std::uint8_t (&self)[kPixelChunk]) {
  const PixelRow pixels = row;  // a copy, which no store below can alias
  float depth_m[kPixelChunk] = {};
  std::copy(pixels.depth_m, pixels.depth_m + pixels.count, depth_m);
  float least_m = std::numeric_limits<float>::max();
  float greatest_m = 0.0F;
  for (int i = 0; i < kPixelChunk; ++i) {
    least_m = lesser(least_m, depth_m[i] > 0.0F ? depth_m[i] : least_m);
    greatest_m = greater(greatest_m, depth_m[i]);
  }
  std::int32_t in[kPixelChunk] = {};
  bool is_any = false;
  for (const CameraBall& ball : balls) {
    const float r = ball.radius_m;
    const float x = ball.centre_m[0];
    const float y = ball.centre_m[1];
    const float z = ball.centre_m[2];
    if (ball.u1 < u || ball.u0 >= u + kPixelChunk) continue;
    if (z + r < least_m || z - r > greatest_m) continue;
    const float r_sq = r * r;
    std::int32_t found = 0;
    for (int i = 0; i < kPixelChunk; ++i) {
      const float d = depth_m[i];
      const float dx = d * (pixels.x_first + static_cast<float>(i) * pixels.x_step) - x;
      const float dy = d * pixels.y - y;
      const float dz = d - z;
      const bool is_in = (d > 0.0F) & (dx * dx + dy * dy + dz * dz <= r_sq);
      in[i] |= is_in ? 1 : 0;
      found |= is_in ? 1 : 0;
    }
    is_any |= found != 0;
  }
  if (!is_any) return false;
  for (int i = 0; i < kPixelChunk; ++i) self[i] = static_cast<std::uint8_t>(in[i]);
  return true;
}

SIDESTEP_SIMD_CLONES
void classify(const PixelRow& row, const PixelRules& rules, PixelFates& fates) {
  constexpr auto kInsert = static_cast<std::int32_t>(PointFate::kInsert);
  constexpr auto kFloor = static_cast<std::int32_t>(PointFate::kFloor);
  constexpr auto kOutOfRange = static_cast<std::int32_t>(PointFate::kOutOfRange);
  constexpr auto kInvalid = static_cast<std::int32_t>(PointFate::kInvalid);
  constexpr std::uint8_t kNone = 255;
  const PixelRow pixels = row;  // copies, which no store below can alias
  const PixelRules limits = rules;
  const float max_range_sq = limits.max_range_m * limits.max_range_m;
  float depth_m[kPixelChunk] = {};
  std::copy(pixels.depth_m, pixels.depth_m + pixels.count, depth_m);
  float carve_m[kPixelChunk];
  std::int32_t wide_fate[kPixelChunk];
  for (int i = 0; i < kPixelChunk; ++i) {
    const float d = depth_m[i];
    const float x = pixels.x_first + static_cast<float>(i) * pixels.x_step;
    const float ray_sq = 1.0F + x * x + pixels.y * pixels.y;
    const float range_sq = d * d * ray_sq;
    const float farthest_m = limits.max_range_m / __builtin_sqrtf(ray_sq);
    const bool valid =
        (d > 0.0F) & (d <= std::numeric_limits<float>::max()) & (range_sq > limits.min_range_sq);
    const bool far = range_sq > max_range_sq;
    const float along_m = far ? farthest_m : d;
    float p_vox[3];
    for (int c = 0; c < 3; ++c) {
      p_vox[c] = pixels.start_vox[c] + along_m * (pixels.across_vox[c] * x + pixels.along_vox[c]);
    }
    const bool low = p_vox[2] < limits.floor_top_vox;
    const bool inserted = valid & !far & !low;
    const bool cleared = (d == 0.0F) & limits.clear_no_return;
    carve_m[i] = valid ? (inserted ? d : -(along_m + limits.band_m))
                       : (cleared ? -(farthest_m + limits.band_m) : 0.0F);
    bool inside = true;
    for (int c = 0; c < 3; ++c) inside &= (p_vox[c] >= 0.0F) & (p_vox[c] < limits.size_vox[c]);
    for (int c = 0; c < 3; ++c) {
      fates.voxel[c][i] = static_cast<std::int32_t>(inside ? p_vox[c] : -1.0F);
    }
    const std::int32_t at_surface = inside ? kInsert : std::int32_t{PixelFates::kOutside};
    wide_fate[i] = valid ? (far ? kOutOfRange : (low ? kFloor : at_surface)) : kInvalid;
  }
  std::uint8_t fate[kPixelChunk];
  for (int i = 0; i < kPixelChunk; ++i) fate[i] = static_cast<std::uint8_t>(wide_fate[i]);
  std::fill(fate + pixels.count, fate + kPixelChunk, kNone);
  if (pixels.self != nullptr) {
    for (int i = 0; i < pixels.count; ++i) {
      if (pixels.self[i] == 0) continue;
      fate[i] = PixelFates::kSelf;
      carve_m[i] = 0.0F;
    }
  }
  std::copy(carve_m, carve_m + pixels.count, pixels.carve_m);
  for (int kind = 0; kind <= PixelFates::kOutside; ++kind) {
    std::uint8_t count = 0;
    for (int i = 0; i < kPixelChunk; ++i) count += fate[i] == kind;
    fates.count[kind] = count;
  }
  std::uint8_t inserted[kPixelChunk];
  std::uint8_t repeats[kPixelChunk] = {};
  for (int i = 0; i < kPixelChunk; ++i) inserted[i] = fate[i] == kInsert;
  for (int i = 1; i < kPixelChunk; ++i) {
    repeats[i] = (fates.voxel[0][i] == fates.voxel[0][i - 1]) &
                 (fates.voxel[1][i] == fates.voxel[1][i - 1]) &
                 (fates.voxel[2][i] == fates.voxel[2][i - 1]);
  }
  const std::uint64_t bits = pack_pixels(inserted);
  fates.insert = bits & ~(pack_pixels(repeats) & (bits << 1));
}

SIDESTEP_SIMD_CLONES
void extremes(const float* values, int width, int rows, float& least, float& greatest) {
  float low[kTile_px];
  float high[kTile_px];
  for (int i = 0; i < kTile_px; ++i) low[i] = least;
  for (int i = 0; i < kTile_px; ++i) high[i] = greatest;
  for (int row = 0; row < rows; ++row, values += width) {
    for (int i = 0; i < kTile_px; ++i) {
      const float value = magnitude(values[i]);
      low[i] = lesser(low[i], value);
      high[i] = greater(high[i], value);
    }
  }
  for (int i = 0; i < kTile_px; ++i) {
    least = lesser(least, low[i]);
    greatest = greater(greatest, high[i]);
  }
}

}  // namespace

BlockOutcome integrate_projected(const Projection& projection, const LogOdds& model,
                                 const BlockRows& block, const float (&base)[3],
                                 int first_surface_layer, const std::uint16_t (&hits)[kBlockRows]) {
  return projected(projection, model, block, base, first_surface_layer, hits);
}

BlockOutcome integrate_free(const LogOdds& model, const BlockRows& block) {
  return free_block(model, block);
}

BlockOutcome integrate_marked(const LogOdds& model, const BlockRows& block,
                              const std::uint16_t (&hits)[kBlockRows],
                              const std::uint16_t (&misses)[kBlockRows]) {
  return marked(model, block, hits, misses);
}

BlockOutcome fade(const LogOdds& model, const BlockRows& block, const Fading& fading) {
  return fade_block(model, block, fading);
}

bool mark_self(const PixelRow& row, int u, std::span<const CameraBall> balls,
               std::uint8_t (&self)[kPixelChunk]) {
  return mark(row, u, balls, self);
}

void classify_pixels(const PixelRow& row, const PixelRules& rules, PixelFates& fates) {
  classify(row, rules, fates);
}

void extremes_of_tile(const float* values, int width, int rows, float& least, float& greatest) {
  extremes(values, width, rows, least, greatest);
}

}  // namespace sidestep::voxel_grid
