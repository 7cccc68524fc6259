#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <sidestep/core/lanes.hpp>
#include <sidestep/field/dense_field.hpp>

// What queries of a dense field work on, between one of its kernels and the next.

namespace sidestep {

/// A voxel as block number and place within the block.
struct Address {
  std::size_t block;
  std::size_t place;
};

SIDESTEP_INLINE Address address_of(int x, int y, int z, int blocks_x, int blocks_y) noexcept {
  // Coordinates are never negative, and unsigned division by a power of two is a shift.
  constexpr auto kSide = static_cast<unsigned>(kBlockSide_vox);
  const auto ux = static_cast<unsigned>(x), uy = static_cast<unsigned>(y),
             uz = static_cast<unsigned>(z);
  const auto nx = static_cast<unsigned>(blocks_x), ny = static_cast<unsigned>(blocks_y);
  return {ux / kSide + nx * (uy / kSide + ny * (uz / kSide)),
          ux % kSide + kSide * (uy % kSide + kSide * (uz % kSide))};
}

SIDESTEP_INLINE bool is_known(const DenseField::KnownBlocks& known, const Address& a) noexcept {
  return ((known.block(a.block).rows[a.place / kBlockSide_vox] >> (a.place % kBlockSide_vox)) &
          1u) != 0;
}

/// Numbers of eight points: their x, then y, then z.
using Coordinates = double[3][kLanes];

/// The grid, in the numbers that kernels want.
struct Bounds {
  double origin_m[3];
  double last[3];      ///< The outermost centre, in voxels from the first.
  double last_low[3];  ///< Lower corner of the last cell.
  double inverse_resolution;
  float last_inside[3];  ///< The last number of voxels from the lower corner that is inside.
  std::int32_t size_vox[3];
  std::int32_t blocks[2];  ///< Along x and y.
  bool is_flat;            ///< One voxel thin along some axis.

  explicit Bounds(const GridSpec& grid)
      : inverse_resolution(1.0 / grid.resolution_m), is_flat(grid.size_vox.minCoeff() < 2) {
    const Eigen::Vector3i counts = block_counts(grid);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      size_vox[axis] = grid.size_vox.data()[axis];
      origin_m[axis] = grid.origin_m.data()[axis];
      last[axis] = size_vox[axis] - 1.0;
      last_inside[axis] = std::nextafter(static_cast<float>(size_vox[axis]), 0.0F);
      last_low[axis] = std::max(0, size_vox[axis] - 2);
      if (axis < 2) blocks[axis] = counts.data()[axis];
    }
  }
};

/// Where eight points lie: positions are in voxels from the centre of voxel (0, 0, 0).
struct Places {
  alignas(64) Coordinates position;
  alignas(64) Coordinates clamped;  ///< Into the box of the outermost centres.
  alignas(
      64) double beyond[kLanes];  ///< Farthest along an axis from there; infinity for no number.
  // Of the nearest voxel.
  alignas(64) std::int32_t block[kLanes];
  alignas(64) std::int32_t place[kLanes];

  /// The grid reaches half a voxel beyond the outermost centres.
  [[nodiscard]] bool is_inside(std::size_t lane) const noexcept { return beyond[lane] <= 0.5; }
  [[nodiscard]] Address nearest(std::size_t lane) const noexcept {
    return {static_cast<std::size_t>(block[lane]), static_cast<std::size_t>(place[lane])};
  }
};

/// Within a cell the interpolant lies below the value at the nearest centre by no more than the way
/// along the axes from there, for along each it changes no faster than from centre to centre; and
/// by no more than the mean way from there to the eight corners, which is longest in the
/// middle: 1.122 voxels.
inline constexpr float kLongestWay_vox = 1.123F;
inline constexpr float kRounding_vox = 0.007F;

/// Some groups of points: of each the voxel that it is nearest to, the value there, and that from
/// which on it is beyond doubt inside the grid and at least as far from obstacles as its limit.
struct Vicinities {
  static constexpr std::size_t kGroups = 32;
  static constexpr std::size_t kPoints = kGroups * kFloatLanes;
  static constexpr unsigned kPlaceBits = std::countr_zero(unsigned{FieldBlock::kVoxels});
  /// What 32 bits can name with the place; of more, points are queried one by one.
  static constexpr std::size_t kMostBlocks = std::size_t{1} << (32U - kPlaceBits);

  alignas(64) std::int32_t address[kPoints];  ///< The block's number, then the place within it.
  alignas(64) float value_m[kPoints];
  alignas(64) float far_m[kPoints];  ///< No number beyond the grid, and for what is no point.

  [[nodiscard]] Address nearest(std::size_t i) const noexcept {
    const auto bits = static_cast<std::uint32_t>(address[i]);
    return {bits >> kPlaceBits, bits % FieldBlock::kVoxels};
  }
};

/// The cells between voxel centres in which points lie.
struct Cells {
  alignas(64) Coordinates fraction;  ///< Within the cell, in [0, 1].
  alignas(64) std::int32_t low[3][kLanes];
  // Of the lowest corner.
  alignas(64) std::int32_t block[kLanes];
  alignas(64) std::int32_t place[kLanes];
  alignas(64) std::int32_t is_cut[kLanes];    ///< Not zero: its corners lie in several blocks.
  alignas(64) float corner[2][2][kLanes][2];  ///< z, y; x last.
};

/// Points that are interpolated in one go: enough for what is read of the field to be in place when
/// vectors of it are wanted.
struct Batch {
  static constexpr std::size_t kGroups = 8;
  static constexpr std::size_t kPoints = kGroups * kLanes;

  std::size_t count = 0;
  PointLanes points_m[kGroups];
  Places places[kGroups];
  Cells cells[kGroups];
  alignas(64) double distances_m[kGroups][kLanes];
  alignas(64) Coordinates gradients[kGroups];

  void put(std::size_t i, const Eigen::Vector3d& p_m) noexcept {
    PointLanes& to_m = points_m[i / kLanes];
    const std::size_t lane = i % kLanes;
    to_m.x[lane] = p_m.x();
    to_m.y[lane] = p_m.y();
    to_m.z[lane] = p_m.z();
  }
  [[nodiscard]] double distance_m(std::size_t i) const noexcept {
    return distances_m[i / kLanes][i % kLanes];
  }
  [[nodiscard]] Eigen::Vector3d gradient(std::size_t i) const noexcept {
    const Coordinates& of = gradients[i / kLanes];
    const std::size_t lane = i % kLanes;
    return {of[0][lane], of[1][lane], of[2][lane]};
  }
  [[nodiscard]] bool is_inside(std::size_t i) const noexcept {
    return places[i / kLanes].is_inside(i % kLanes);
  }
  [[nodiscard]] FieldStatus status(std::size_t i,
                                   const DenseField::KnownBlocks& known) const noexcept {
    const bool is_seen = is_known(known, places[i / kLanes].nearest(i % kLanes));
    const FieldStatus inside = is_seen ? FieldStatus::kKnown : FieldStatus::kUnknown;
    return is_inside(i) ? inside : FieldStatus::kOutside;
  }
};

}  // namespace sidestep
