#ifndef SIDESTEP_KERNELS
#include <sidestep/field/dense_field.hpp>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include <sidestep/core/lanes.hpp>

#include "dense_query.hpp"

namespace sidestep {
namespace {

/// Reads the values of `count` points; with `known`, minus infinity for those in unknown space, so
/// that they are listed.
void read_values(const DenseField::Blocks& blocks, const DenseField::KnownBlocks* known,
                 std::size_t count, Vicinities& of) noexcept {
  const auto value_m = [&](const Address& a) { return blocks.block(a.block).distance_m[a.place]; };
  if (known == nullptr) {
#pragma GCC unroll 8
    for (std::size_t i = 0; i < count; ++i) of.value_m[i] = value_m(of.nearest(i));
    return;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const Address a = of.nearest(i);
    of.value_m[i] = is_known(*known, a) ? value_m(a) : -std::numeric_limits<float>::infinity();
  }
}

}  // namespace
}  // namespace sidestep

#define SIDESTEP_KERNELS "dense_field.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {

DenseField::DenseField(FieldInfo info, Blocks blocks, KnownBlocks known)
    : DistanceField(std::move(info)),
      blocks_(std::move(blocks)),
      known_(std::move(known)),
      block_counts_(block_counts(this->info().grid)) {}

float DenseField::at(const Eigen::Vector3i& voxel) const noexcept {
  const Address a =
      address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_.x(), block_counts_.y());
  return blocks_.block(a.block).distance_m[a.place];
}

bool DenseField::known(const Eigen::Vector3i& voxel) const noexcept {
  return is_known(
      known_, address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_.x(), block_counts_.y()));
}

void DenseField::query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) const noexcept {
  const Bounds bounds(info().grid);
  Batch batch;
  for (std::size_t first = 0; first < points_m.size(); first += batch.count) {
    batch.count = std::min(Batch::kPoints, points_m.size() - first);
    for (std::size_t i = 0; i < padded(batch.count); ++i) {
      batch.put(i, i < batch.count ? points_m[first + i] : Eigen::Vector3d::Zero());
    }
    SIDESTEP_DISPATCH(sample)(blocks_, bounds, batch);
    for (std::size_t i = 0; i < batch.count; ++i) {
      const std::size_t n = first + i;
      distances_m[n] = batch.distance_m(i);
      if (!gradients.empty()) gradients[n] = batch.gradient(i);
      if (!statuses.empty()) statuses[n] = batch.status(i, known_);
    }
  }
}

std::size_t DenseField::query_below(std::span<const PointFloats> points_m,
                                    std::span<const double> limits_m, bool also_unknown,
                                    std::span<FieldSample> samples) const noexcept {
  if (blocks_.size() > Vicinities::kMostBlocks) {
    return DistanceField::query_below(points_m, limits_m, also_unknown, samples);
  }
  const Bounds bounds(info().grid);
  const auto steepest_voxel_m = static_cast<float>(info().lipschitz / bounds.inverse_resolution);
  std::size_t written = 0;
  Vicinities vicinities;
  std::array<std::int32_t, Vicinities::kPoints> list;
  Batch near;
  for (std::size_t first = 0; first < points_m.size(); first += Vicinities::kGroups) {
    const auto some_m =
        points_m.subspan(first, std::min(Vicinities::kGroups, points_m.size() - first));
    const auto limits = limits_m.subspan(first, some_m.size());
    SIDESTEP_DISPATCH(find_vicinities)(some_m, limits, bounds, steepest_voxel_m, vicinities);
    read_values(blocks_, also_unknown ? &known_ : nullptr, some_m.size() * kFloatLanes, vicinities);
    const std::size_t listed = SIDESTEP_DISPATCH(list_near)(vicinities, some_m.size(), list.data());
    for (std::size_t begin = 0; begin < listed; begin += near.count) {
      near.count = std::min(Batch::kPoints, listed - begin);
      const std::int32_t* const points = list.data() + begin;
      SIDESTEP_DISPATCH(collect)(some_m, points, near);
      SIDESTEP_DISPATCH(sample)(blocks_, bounds, near);
      // Without branches, too: two in five are not below.
      for (std::size_t k = 0; k < near.count; ++k) {
        const auto point = static_cast<std::size_t>(points[k]);
        const double distance_m = near.distance_m(k);
        const FieldStatus status = near.status(k, known_);
        const auto is_below = static_cast<unsigned>(!(distance_m >= limits[point / kFloatLanes]));
        const auto is_outside = static_cast<unsigned>(status == FieldStatus::kOutside);
        const auto is_unknown = static_cast<unsigned>(status == FieldStatus::kUnknown) &
                                static_cast<unsigned>(also_unknown);
        samples[written] = {first * kFloatLanes + point, status, distance_m, near.gradient(k)};
        written += is_below | is_outside | is_unknown;
      }
    }
  }
  return written;
}

}  // namespace sidestep

#else

namespace {

// Points are queried kLanes at once, with vector extensions, because g++ 12 unrolls loops over so
// few values before it could vectorise them.

/// Integers of kLanes points.
using Indices = HalfIntegers;
using FloatIndices = Line<std::int32_t, kParts>;

SIDESTEP_INLINE Indices& indices(std::int32_t* at) noexcept {
  return *reinterpret_cast<Indices*>(at);
}
SIDESTEP_INLINE FloatIndices& float_indices(std::int32_t* at) noexcept {
  return *reinterpret_cast<FloatIndices*>(at);
}

SIDESTEP_INLINE void locate(const PointLanes& points_m, const Bounds& bounds,
                            Places& places) noexcept {
  const double* coordinates_m[] = {points_m.x, points_m.y, points_m.z};
  constexpr int kSide = kBlockSide_vox;
  constexpr int kShift = std::countr_zero(unsigned{kSide});
  const Lanes infinity = Lanes{} + std::numeric_limits<double>::infinity();
  Lanes farthest = {};
  Indices block = {}, place = {};
  for (std::size_t axis = 3; axis-- > 0;) {
    Lanes p =
        (lanes(coordinates_m[axis]) - bounds.origin_m[axis]) * bounds.inverse_resolution - 0.5;
    p = choose(p == p, p, infinity);
    const Lanes clamped = lesser(greater(p, Lanes{}), Lanes{} + bounds.last[axis]);
    lanes(places.position[axis]) = p;
    lanes(places.clamped[axis]) = clamped;
    farthest = greater(abs(p - clamped), farthest);
    Indices nearest;
    truncate(clamped + 0.5, nearest);
    block = (nearest >> kShift) + (axis < 2 ? bounds.blocks[axis] * block : block);
    place = (nearest & (kSide - 1)) + kSide * place;
  }
  lanes(places.beyond) = farthest;
  indices(places.block) = block;
  indices(places.place) = place;
}

/// Of at most kGroups groups. steepest_voxel_m: how much values differ from voxel to voxel at most.
/// Within the grid kRounding covers single precision.
void find_vicinities(std::span<const PointFloats> points_m, std::span<const double> limits_m,
                     const Bounds& given_bounds, float steepest_voxel_m, Vicinities& out) noexcept {
  constexpr int kSide = kBlockSide_vox;
  constexpr int kShift = std::countr_zero(unsigned{kSide});
  const Bounds bounds = given_bounds;  // which stores of lanes do not alias
  const auto scale = static_cast<float>(bounds.inverse_resolution);
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const float* coordinates_m[] = {points_m[i].x, points_m[i].y, points_m[i].z};
    FloatLanes excess = {};  // squared, beyond the grid; no number for what is no point
    FloatLanes way = {};     // along the axes, to the nearest centre, in voxels
    FloatIndices block = {}, place = {};
#pragma GCC unroll 3
    for (std::size_t axis = 3; axis-- > 0;) {
      const FloatLanes p =
          scale * (lanes(coordinates_m[axis]) - static_cast<float>(bounds.origin_m[axis]));
      const FloatLanes last = FloatLanes{} + bounds.last_inside[axis];
      const FloatLanes clamped = lesser(greater(p, FloatLanes{}), last);
      excess += (p - clamped) * (p - clamped);
      const FloatIndices nearest = integers_of(clamped);
      way += abs(clamped - floats_of(nearest) - 0.5F);
      block = (nearest >> kShift) + (axis < 2 ? bounds.blocks[axis] * block : block);
      place = (nearest & (kSide - 1)) + kSide * place;
    }
    way = lesser(way, FloatLanes{} + kLongestWay_vox);
    const FloatLanes far = steepest_voxel_m * (way + kRounding_vox) +
                           static_cast<float>(sidestep::greater(limits_m[i], 0.0));
    lanes(out.far_m + i * kFloatLanes) =
        choose(excess == 0.0F, far, std::numeric_limits<float>::quiet_NaN());
    float_indices(out.address + i * kFloatLanes) =
        (block << static_cast<int>(Vicinities::kPlaceBits)) | place;
  }
}

/// Writes those points that are not far, one after the other, and beyond them anything; returns how
/// many they are. Without branches: which are near cannot be predicted. A template, for only one of
/// the instruction sets has what its first part calls.
template <class Holds, class Points>
SIDESTEP_INLINE std::size_t write_near(const Holds& is_far, const Points& points,
                                       std::int32_t* to) noexcept {
  if constexpr (kParts == 1) {
    const auto far = __builtin_ia32_cvtd2mask512(is_far.parts[0]);
    const auto& all = points.parts[0];
    float_indices(to).parts[0] = __builtin_ia32_compresssi512_mask(all, all, ~far);
    return kFloatLanes - static_cast<std::size_t>(std::popcount(far));
  } else {
    std::size_t written = 0;
    for (std::size_t lane = 0; lane < kFloatLanes; ++lane) {
      to[written] = points[lane];
      written += static_cast<std::size_t>(is_far[lane] + 1);
    }
    return written;
  }
}

/// Lists which of the points are not beyond doubt far from obstacles. `list` has room for all.
std::size_t list_near(const Vicinities& of, std::size_t groups, std::int32_t* list) noexcept {
  FloatIndices points;
  count_lanes(points);
  std::size_t listed = 0;
  for (std::size_t at = 0; at < groups * kFloatLanes; at += kFloatLanes) {
    // Where either is no number, a point is not far.
    const auto is_far = lanes(of.far_m + at) <= lanes(of.value_m + at);
    listed += write_near(is_far, points, list + listed);
    points += static_cast<std::int32_t>(kFloatLanes);
  }
  return listed;
}

SIDESTEP_INLINE void find_cells(const Places& places, const Bounds& bounds, Cells& cells) noexcept {
  constexpr int kSide = kBlockSide_vox;
  constexpr int kShift = std::countr_zero(unsigned{kSide});
  Indices block = {}, place = {}, cut = Indices{} + (bounds.is_flat ? kSide : 0);
  for (std::size_t axis = 3; axis-- > 0;) {
    const Lanes clamped = lanes(places.clamped[axis]);
    Indices low;
    truncate(lesser(clamped, Lanes{} + bounds.last_low[axis]), low);
    Lanes corner;
    find_numbers(low, corner);
    lanes(cells.fraction[axis]) = clamped - corner;
    indices(cells.low[axis]) = low;
    const Indices within = low & (kSide - 1);
    block = (low >> kShift) + (axis < 2 ? bounds.blocks[axis] * block : block);
    place = within + kSide * place;
    cut |= (within + 1) & kSide;
  }
  indices(cells.block) = block;
  indices(cells.place) = place;
  indices(cells.is_cut) = cut;
}

/// Reads the corners of a cell that lie in several blocks, or where there is but one voxel. Called,
/// so that it takes no registers from the many cells that are not cut.
[[gnu::noinline]] void read_cut_corners(const DenseField::Blocks& blocks, const Bounds& bounds,
                                        Cells& cells, std::size_t from, std::size_t lane) noexcept {
  Address at[3][2];  // what each coordinate of a corner adds to its address
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (int side = 0; side < 2; ++side) {
      const int voxel = std::min(cells.low[axis][from] + side, bounds.size_vox[axis] - 1);
      at[axis][side] = address_of(axis == 0 ? voxel : 0, axis == 1 ? voxel : 0,
                                  axis == 2 ? voxel : 0, bounds.blocks[0], bounds.blocks[1]);
    }
  }
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      for (std::size_t i = 0; i < 2; ++i) {
        const Address a{at[0][i].block + at[1][j].block + at[2][k].block,
                        at[0][i].place + at[1][j].place + at[2][k].place};
        cells.corner[k][j][lane][i] = blocks.block(a.block).distance_m[a.place];
      }
    }
  }
}

/// Reads the eight corners of the cell of `from` into a lane.
SIDESTEP_INLINE void read_corners(const DenseField::Blocks& blocks, const Bounds& bounds,
                                  Cells& cells, std::size_t from, std::size_t lane) noexcept {
  constexpr std::size_t kSide = kBlockSide_vox;
  if (cells.is_cut[from] != 0) return read_cut_corners(blocks, bounds, cells, from, lane);
  // Four cells in five lie within a block, where one address serves all corners.
  const FieldBlock& block = blocks.block(static_cast<std::size_t>(cells.block[from]));
  const float* first = block.distance_m.data() + cells.place[from];
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      std::memcpy(cells.corner[k][j][lane], first + kSide * (j + kSide * k), 2 * sizeof(float));
    }
  }
}

/// The trilinear interpolant of the cells' corners, and its gradient per metre.
SIDESTEP_INLINE void interpolate(const Cells& cells, const Places& places, const Bounds& bounds,
                                 double (&values)[kLanes], Coordinates& gradients) noexcept {
  const Lanes x = lanes(cells.fraction[0]), y = lanes(cells.fraction[1]),
              z = lanes(cells.fraction[2]);
  Lanes along_x[2][2], slope_x[2][2];  // z, y
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      Lanes low, high;
      part_pairs(cells.corner[k][j], low, high);
      slope_x[k][j] = high - low;
      along_x[k][j] = low + x * slope_x[k][j];
    }
  }
  const Lanes slope_y0 = along_x[0][1] - along_x[0][0], slope_y1 = along_x[1][1] - along_x[1][0];
  const Lanes y0 = along_x[0][0] + y * slope_y0, y1 = along_x[1][0] + y * slope_y1;
  const Lanes x0 = slope_x[0][0] + y * (slope_x[0][1] - slope_x[0][0]);
  const Lanes x1 = slope_x[1][0] + y * (slope_x[1][1] - slope_x[1][0]);
  const Lanes slopes[3] = {x0 + z * (x1 - x0), slope_y0 + z * (slope_y1 - slope_y0), y1 - y0};
  Lanes value = y0 + z * slopes[2];
  // Zero for a number, else not one.
  const Lanes none =
      (lanes(places.position[0]) + lanes(places.position[1]) + lanes(places.position[2])) * 0.0;
  value = choose(none == 0.0, value, none);
  lanes(values) = value;
  const Lanes per_m = choose(none == 0.0, Lanes{} + bounds.inverse_resolution, 0.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Beyond the outermost centres the value no longer changes along that axis.
    const Lanes slope = slopes[axis] * per_m;
    lanes(gradients[axis]) =
        choose(lanes(places.position[axis]) == lanes(places.clamped[axis]), slope, 0.0);
  }
}

/// Puts as many listed points into a batch as it counts.
void collect(std::span<const PointFloats> points_m, const std::int32_t* list,
             Batch& batch) noexcept {
  alignas(64) float x_m[Batch::kPoints], y_m[Batch::kPoints], z_m[Batch::kPoints];
  for (std::size_t k = 0; k < batch.count; ++k) {
    const auto point = static_cast<std::size_t>(list[k]), lane = point % kFloatLanes;
    const PointFloats& of_m = points_m[point / kFloatLanes];
    x_m[k] = of_m.x[lane];
    y_m[k] = of_m.y[lane];
    z_m[k] = of_m.z[lane];
  }
  for (std::size_t k = batch.count; k < padded(batch.count); ++k) x_m[k] = y_m[k] = z_m[k] = 0.0F;
  for (std::size_t k = 0; k < batch.count; k += kLanes) {
    PointLanes& to_m = batch.points_m[k / kLanes];
    read_halves(x_m + k, lanes(to_m.x));
    read_halves(y_m + k, lanes(to_m.y));
    read_halves(z_m + k, lanes(to_m.z));
  }
}

/// Distances and gradients of the points of a batch, whose last lanes are filled.
void sample(const DenseField::Blocks& blocks, const Bounds& bounds, Batch& batch) noexcept {
  const std::size_t groups = padded(batch.count) / kLanes;
  for (std::size_t g = 0; g < groups; ++g) {
    locate(batch.points_m[g], bounds, batch.places[g]);
    find_cells(batch.places[g], bounds, batch.cells[g]);
  }
  for (std::size_t g = 0; g < groups; ++g) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const std::size_t last = batch.count - 1 - g * kLanes;
      read_corners(blocks, bounds, batch.cells[g], std::min(lane, last), lane);
    }
  }
  for (std::size_t g = 0; g < groups; ++g) {
    interpolate(batch.cells[g], batch.places[g], bounds, batch.distances_m[g], batch.gradients[g]);
  }
}

}  // namespace

#endif
