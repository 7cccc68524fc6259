#include <sidestep/field/dense_field.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

// Sanitizers run before the resolvers of multi-versioned functions could.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && defined(__OPTIMIZE__)
#define SIDESTEP_SIMD_CLONES [[gnu::target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")]]
#else
#define SIDESTEP_SIMD_CLONES
#endif

namespace sidestep {
namespace {

/// A voxel as block number and place within the block.
struct Address {
  std::size_t block;
  std::size_t place;
};

Address address_of(int x, int y, int z, const Eigen::Vector3i& counts) noexcept {
  // Coordinates are never negative, and unsigned division by a power of two is a shift.
  constexpr auto kSide = static_cast<unsigned>(kBlockSide_vox);
  const auto ux = static_cast<unsigned>(x), uy = static_cast<unsigned>(y),
             uz = static_cast<unsigned>(z);
  const auto nx = static_cast<unsigned>(counts.x()), ny = static_cast<unsigned>(counts.y());
  return {ux / kSide + nx * (uy / kSide + ny * (uz / kSide)),
          ux % kSide + kSide * (uy % kSide + kSide * (uz % kSide))};
}

/// As many points as are queried at once. Vector extensions, because g++ 12 unrolls loops over so
/// few values before it could vectorise them.
constexpr std::size_t kLanes = 8;
using Lanes = double __attribute__((vector_size(8 * kLanes), aligned(8), may_alias));
using Indices = std::int32_t __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));

/// Numbers of eight points: x, y and z of the first, then of the second, and so on.
using Coordinates = double[3 * kLanes];

/// What depends on the grid alone, repeated for eight points.
struct Bounds {
  alignas(64) Coordinates origin_m;
  alignas(64) Coordinates last;      ///< The outermost centre, in voxels from the first.
  alignas(64) Coordinates last_low;  ///< Lower corner of the last cell.
  double inverse_resolution;

  explicit Bounds(const GridSpec& grid) : inverse_resolution(1.0 / grid.resolution_m) {
    for (std::size_t i = 0; i < 3 * kLanes; ++i) {
      const int size = grid.size_vox.data()[i % 3];
      origin_m[i] = grid.origin_m.data()[i % 3];
      last[i] = size - 1.0;
      last_low[i] = std::max(0, size - 2);
    }
  }
};

/// Where points lie: positions are in voxels from the centre of voxel (0, 0, 0).
struct Cells {
  alignas(64) Coordinates position;
  alignas(64) Coordinates clamped;   ///< Into the box of the outermost centres; 0 for no number.
  alignas(64) Coordinates fraction;  ///< Within the cell, in [0, 1].
  alignas(64) std::int32_t low[3 * kLanes];
  alignas(64) float corner[2][2][2][kLanes];  ///< z, y, x.
};

/// `points_m`: of eight points.
SIDESTEP_SIMD_CLONES
void locate(const double* points_m, const Bounds& bounds, Cells& cells) noexcept {
  const auto lanes = [](const double* at) { return reinterpret_cast<const Lanes*>(at); };
  for (std::size_t i = 0; i < 3 * kLanes; i += kLanes) {
    const Lanes last = *lanes(bounds.last + i), last_low = *lanes(bounds.last_low + i);
    const Lanes p =
        (*lanes(points_m + i) - *lanes(bounds.origin_m + i)) * bounds.inverse_resolution - 0.5;
    Lanes clamped = p > 0.0 ? p : Lanes{};  // NaN is not above 0
    clamped = clamped < last ? clamped : last;
    const Lanes below = clamped < last_low ? clamped : last_low;
    const Indices low = __builtin_convertvector(below, Indices);
    *reinterpret_cast<Lanes*>(cells.position + i) = p;
    *reinterpret_cast<Lanes*>(cells.clamped + i) = clamped;
    *reinterpret_cast<Lanes*>(cells.fraction + i) = clamped - __builtin_convertvector(low, Lanes);
    *reinterpret_cast<Indices*>(cells.low + i) = low;
  }
}

/// The trilinear interpolant of the cells' corners, and its gradient per voxel.
SIDESTEP_SIMD_CLONES
void interpolate(const Cells& cells, double (&values)[kLanes], Coordinates& gradients) noexcept {
  const auto mix = [](double a, double b, double t) { return a + t * (b - a); };
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const double x = cells.fraction[3 * lane], y = cells.fraction[3 * lane + 1],
                 z = cells.fraction[3 * lane + 2];
    const auto at = [&](int k, int j, int i) {
      return static_cast<double>(cells.corner[k][j][i][lane]);
    };
    const auto slope_x = [&](int k, int j) { return at(k, j, 1) - at(k, j, 0); };
    const auto along_x = [&](int k, int j) { return at(k, j, 0) + x * slope_x(k, j); };
    const double y0 = mix(along_x(0, 0), along_x(0, 1), y);
    const double y1 = mix(along_x(1, 0), along_x(1, 1), y);
    values[lane] = mix(y0, y1, z);
    gradients[3 * lane] =
        mix(mix(slope_x(0, 0), slope_x(0, 1), y), mix(slope_x(1, 0), slope_x(1, 1), y), z);
    gradients[3 * lane + 1] = mix(along_x(0, 1) - along_x(0, 0), along_x(1, 1) - along_x(1, 0), z);
    gradients[3 * lane + 2] = y1 - y0;
  }
}

/// Reads the eight corners of one lane's cell.
void read_corners(const DenseField::Blocks& blocks, const GridSpec& grid,
                  const Eigen::Vector3i& counts, Cells& cells, std::size_t lane) noexcept {
  constexpr int kSide = kBlockSide_vox;
  const int x = cells.low[3 * lane], y = cells.low[3 * lane + 1], z = cells.low[3 * lane + 2];
  const auto inside = [](int low) { return low % kSide != kSide - 1; };
  if (inside(x) && inside(y) && inside(z) && grid.size_vox.minCoeff() > 1) {
    // Four cells in five lie within a block, where one address serves all corners.
    const Address a = address_of(x, y, z, counts);
    const float* first = &blocks.block(a.block).distance_m[a.place];
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < 2; ++j) {
        const float* pair = first + kSide * (j + kSide * k);
        cells.corner[k][j][0][lane] = pair[0];
        cells.corner[k][j][1][lane] = pair[1];
      }
    }
    return;
  }
  const Eigen::Vector3i last = grid.size_vox.array() - 1;
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 2; ++i) {
        const Address a = address_of(std::min(x + i, last.x()), std::min(y + j, last.y()),
                                     std::min(z + k, last.z()), counts);
        cells.corner[k][j][i][lane] = blocks.block(a.block).distance_m[a.place];
      }
    }
  }
}

}  // namespace

DenseField::DenseField(FieldInfo info, Blocks blocks, KnownBlocks known)
    : DistanceField(std::move(info)),
      blocks_(std::move(blocks)),
      known_(std::move(known)),
      block_counts_(block_counts(this->info().grid)) {}

float DenseField::at(const Eigen::Vector3i& voxel) const noexcept {
  const Address a = address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_);
  return blocks_.block(a.block).distance_m[a.place];
}

bool DenseField::known(const Eigen::Vector3i& voxel) const noexcept {
  const Address a = address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_);
  return ((known_.block(a.block).rows[a.place / kBlockSide_vox] >> (a.place % kBlockSide_vox)) &
          1u) != 0;
}

void DenseField::query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) const noexcept {
  const GridSpec& grid = info().grid;
  const Bounds bounds(grid);
  const Eigen::Vector3d beyond = grid.size_vox.cast<double>().array() - 0.5;
  const auto status_at = [&](const Eigen::Vector3d& p, const Eigen::Vector3d& clamped) {
    const bool inside = (p.array() >= -0.5).all() && (p.array() <= beyond.array()).all();
    if (!inside) return FieldStatus::kOutside;
    const Eigen::Vector3i nearest = (clamped.array() + 0.5).cast<int>().matrix();
    return known(nearest) ? FieldStatus::kKnown : FieldStatus::kUnknown;
  };
  for (std::size_t first = 0; first < points_m.size(); first += kLanes) {
    const std::size_t count = std::min(kLanes, points_m.size() - first);
    Cells cells;
    if (count == kLanes) {
      locate(points_m[first].data(), bounds, cells);
    } else {
      Eigen::Vector3d padded[kLanes];
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        padded[lane] = points_m[first + std::min(lane, count - 1)];
      }
      locate(padded[0].data(), bounds, cells);
    }
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      read_corners(blocks_, grid, block_counts_, cells, lane);
    }
    alignas(64) double values[kLanes];
    alignas(64) Coordinates slopes;
    interpolate(cells, values, slopes);

    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t n = first + lane;
      const Eigen::Map<const Eigen::Vector3d> p(&cells.position[3 * lane]);
      const Eigen::Map<const Eigen::Vector3d> clamped(&cells.clamped[3 * lane]);
      const bool is_point = std::isfinite(p.sum());
      distances_m[n] = is_point ? values[lane] : std::numeric_limits<double>::quiet_NaN();
      if (!gradients.empty()) {
        for (int axis = 0; axis < 3; ++axis) {
          // Beyond the outermost centres the value no longer changes along that axis.
          const bool changes = is_point && p[axis] == clamped[axis];
          gradients[n][axis] = changes ? slopes[3 * lane + static_cast<std::size_t>(axis)] *
                                             bounds.inverse_resolution
                                       : 0.0;
        }
      }
      if (!statuses.empty()) statuses[n] = status_at(p, clamped);
    }
  }
}

}  // namespace sidestep
