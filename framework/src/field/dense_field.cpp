#include <sidestep/field/dense_field.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include <sidestep/core/lanes.hpp>

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

bool is_known(const DenseField::KnownBlocks& known, const Address& a) noexcept {
  return ((known.block(a.block).rows[a.place / kBlockSide_vox] >> (a.place % kBlockSide_vox)) &
          1u) != 0;
}

// Points are queried kLanes at once, with vector extensions, because g++ 12 unrolls loops over so
// few values before it could vectorise them.
using Indices = std::int32_t __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));

using sidestep::lanes;
[[gnu::always_inline]] inline Indices& lanes(std::int32_t* at) noexcept {
  return *reinterpret_cast<Indices*>(at);
}
[[gnu::always_inline]] inline const Indices& lanes(const std::int32_t* at) noexcept {
  return *reinterpret_cast<const Indices*>(at);
}
// Comparisons stand in conditional expressions only, and are never combined: g++ 12 makes eight
// scalar ones of them otherwise.

/// Numbers of eight points: their x, then y, then z.
using Coordinates = double[3][kLanes];

/// The grid, in the numbers that kernels want.
struct Bounds {
  double origin_m[3];
  double last[3];      ///< The outermost centre, in voxels from the first.
  double last_low[3];  ///< Lower corner of the last cell.
  double inverse_resolution;
  std::int32_t counts[2];  ///< Blocks along x and y.

  explicit Bounds(const GridSpec& grid) : inverse_resolution(1.0 / grid.resolution_m) {
    const Eigen::Vector3i blocks = block_counts(grid);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const int size = grid.size_vox.data()[axis];
      origin_m[axis] = grid.origin_m.data()[axis];
      last[axis] = size - 1.0;
      last_low[axis] = std::max(0, size - 2);
      if (axis < 2) counts[axis] = blocks.data()[axis];
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

SIDESTEP_SIMD_CLONES
void locate(const PointLanes& points_m, const Bounds& bounds, Places& places) noexcept {
  const double* coordinates_m[] = {points_m.x, points_m.y, points_m.z};
  constexpr int kSide = kBlockSide_vox;
  constexpr int kShift = std::countr_zero(unsigned{kSide});
  const Lanes infinity = Lanes{} + std::numeric_limits<double>::infinity();
  Lanes farthest = {};
  Indices block = {}, place = {};
  for (std::size_t axis = 3; axis-- > 0;) {
    Lanes p =
        (lanes(coordinates_m[axis]) - bounds.origin_m[axis]) * bounds.inverse_resolution - 0.5;
    p = p == p ? p : infinity;
    Lanes clamped = p > 0.0 ? p : Lanes{};
    clamped = clamped < bounds.last[axis] ? clamped : Lanes{} + bounds.last[axis];
    lanes(places.position[axis]) = p;
    lanes(places.clamped[axis]) = clamped;
    Lanes beyond = p - clamped;
    beyond = beyond > 0.0 ? beyond : -beyond;
    farthest = beyond > farthest ? beyond : farthest;
    const Indices nearest = __builtin_convertvector(clamped + 0.5, Indices);
    block = (nearest >> kShift) + (axis < 2 ? bounds.counts[axis] * block : block);
    place = (nearest & (kSide - 1)) + kSide * place;
  }
  lanes(places.beyond) = farthest;
  lanes(places.block) = block;
  lanes(places.place) = place;
}

/// How far the farthest of eight points is from one of them; infinity if one is no point.
SIDESTEP_SIMD_CLONES
double radius_about(const PointLanes& points_m, std::size_t middle) noexcept {
  const Lanes x = lanes(points_m.x) - points_m.x[middle];
  const Lanes y = lanes(points_m.y) - points_m.y[middle];
  const Lanes z = lanes(points_m.z) - points_m.z[middle];
  const Lanes squares = x * x + y * y + z * z;
  double most = 0.0;
  double sum = 0.0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    most = std::max(most, squares[lane]);
    sum += squares[lane];
  }
  return std::isfinite(sum) ? std::sqrt(most) : std::numeric_limits<double>::infinity();
}

/// The cells between voxel centres in which points lie.
struct Cells {
  alignas(64) Coordinates fraction;  ///< Within the cell, in [0, 1].
  alignas(64) std::int32_t low[3][kLanes];
  alignas(64) float corner[2][2][2][kLanes];  ///< z, y, x.
};

SIDESTEP_SIMD_CLONES
void find_cells(const Places& places, const Bounds& bounds, Cells& cells) noexcept {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Lanes clamped = lanes(places.clamped[axis]);
    const Lanes last_low = Lanes{} + bounds.last_low[axis];
    const Lanes below = clamped < last_low ? clamped : last_low;
    const Indices low = __builtin_convertvector(below, Indices);
    lanes(cells.fraction[axis]) = clamped - __builtin_convertvector(low, Lanes);
    lanes(cells.low[axis]) = low;
  }
}

/// The trilinear interpolant of the cells' corners, and its gradient per metre.
SIDESTEP_SIMD_CLONES
void interpolate(const Cells& cells, const Places& places, const Bounds& bounds,
                 double (&values)[kLanes], Coordinates& gradients) noexcept {
  using Floats = float __attribute__((vector_size(4 * kLanes), aligned(4), may_alias));
  const Lanes x = lanes(cells.fraction[0]), y = lanes(cells.fraction[1]),
              z = lanes(cells.fraction[2]);
  Lanes along_x[2][2], slope_x[2][2];  // z, y
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t j = 0; j < 2; ++j) {
      const auto& corners = reinterpret_cast<const Floats(&)[2]>(cells.corner[k][j]);
      const Lanes low = __builtin_convertvector(corners[0], Lanes);
      slope_x[k][j] = __builtin_convertvector(corners[1], Lanes) - low;
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
  value = none == 0.0 ? value : none;
  lanes(values) = value;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    // Beyond the outermost centres the value no longer changes along that axis.
    Lanes slope = slopes[axis] * bounds.inverse_resolution;
    slope = lanes(places.position[axis]) == lanes(places.clamped[axis]) ? slope : Lanes{};
    lanes(gradients[axis]) = none == 0.0 ? slope : Lanes{};
  }
}

/// Eight points of a batch from one on; the last stands in for those beyond its end.
PointLanes pack(std::span<const Eigen::Vector3d> points_m, std::size_t first) noexcept {
  PointLanes packed;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Eigen::Vector3d& p = points_m[std::min(first + lane, points_m.size() - 1)];
    packed.x[lane] = p.x();
    packed.y[lane] = p.y();
    packed.z[lane] = p.z();
  }
  return packed;
}

Eigen::Vector3d vector_of(const Coordinates& values, std::size_t lane) noexcept {
  return {values[0][lane], values[1][lane], values[2][lane]};
}

/// Reads a dense field for up to eight points at once.
class Sampler {
 public:
  explicit Sampler(const DenseField& field) noexcept
      : field_(field), grid_(field.info().grid), counts_(block_counts(grid_)), bounds_(grid_) {}

  void locate_points(const PointLanes& points_m, Places& places) const noexcept {
    locate(points_m, bounds_, places);
  }

  /// The value at the nearest voxel centre.
  [[nodiscard]] float nearest_m(const Places& places, std::size_t lane) const noexcept {
    const Address a = places.nearest(lane);
    return field_.blocks().block(a.block).distance_m[a.place];
  }

  [[nodiscard]] FieldStatus status(const Places& places, std::size_t lane) const noexcept {
    if (!places.is_inside(lane)) return FieldStatus::kOutside;
    return is_known(field_.known_blocks(), places.nearest(lane)) ? FieldStatus::kKnown
                                                                 : FieldStatus::kUnknown;
  }

  /// Whether all points lie inside the grid and, as seen from one of them, are farther than `far_m`
  /// by value at the nearest centre. False where that is not certain at once.
  [[nodiscard]] bool are_far(const PointLanes& points_m, double far_m) const noexcept {
    constexpr std::size_t kMiddle = kLanes / 2;
    const double* coordinates_m[] = {points_m.x, points_m.y, points_m.z};
    const double radius_m = radius_about(points_m, kMiddle);
    int voxel[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double p =
          (coordinates_m[axis][kMiddle] - bounds_.origin_m[axis]) * bounds_.inverse_resolution;
      const double reach = radius_m * bounds_.inverse_resolution;
      if (!(p >= reach && p + reach <= bounds_.last[axis] + 1.0)) return false;
      voxel[axis] = std::min(static_cast<int>(p), static_cast<int>(bounds_.last[axis]));
    }
    const Address a = address_of(voxel[0], voxel[1], voxel[2], counts_);
    // From the one nearest centre to another it is no farther than from point to point and the
    // halves of two voxels' diagonals.
    const double way_m = radius_m + std::sqrt(3.0) * grid_.resolution_m;
    return field_.blocks().block(a.block).distance_m[a.place] >=
           far_m + field_.info().steepest * way_m;
  }

  /// Distances and gradients of the first `count` points.
  void interpolate_at(const Places& places, std::size_t count, double (&distances_m)[kLanes],
                      Coordinates& gradients) const noexcept {
    Cells cells;
    find_cells(places, bounds_, cells);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      read_corners(cells, std::min(lane, count - 1), lane);
    }
    interpolate(cells, places, bounds_, distances_m, gradients);
  }

 private:
  /// Reads the eight corners of the cell of `from` into a lane.
  void read_corners(Cells& cells, std::size_t from, std::size_t lane) const noexcept {
    constexpr int kSide = kBlockSide_vox;
    const int x = cells.low[0][from], y = cells.low[1][from], z = cells.low[2][from];
    const auto inside = [](int low) { return low % kSide != kSide - 1; };
    if (inside(x) && inside(y) && inside(z) && grid_.size_vox.minCoeff() > 1) {
      // Four cells in five lie within a block, where one address serves all corners.
      const Address a = address_of(x, y, z, counts_);
      const float* first = &field_.blocks().block(a.block).distance_m[a.place];
      for (int k = 0; k < 2; ++k) {
        for (int j = 0; j < 2; ++j) {
          const float* pair = first + kSide * (j + kSide * k);
          cells.corner[k][j][0][lane] = pair[0];
          cells.corner[k][j][1][lane] = pair[1];
        }
      }
      return;
    }
    const Eigen::Vector3i last = grid_.size_vox.array() - 1;
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < 2; ++j) {
        for (int i = 0; i < 2; ++i) {
          const Address a = address_of(std::min(x + i, last.x()), std::min(y + j, last.y()),
                                       std::min(z + k, last.z()), counts_);
          cells.corner[k][j][i][lane] = field_.blocks().block(a.block).distance_m[a.place];
        }
      }
    }
  }

  const DenseField& field_;
  const GridSpec& grid_;
  Eigen::Vector3i counts_;
  Bounds bounds_;
};

/// Points that may lie below their limits, gathered until there are kLanes of them.
struct Candidates {
  PointLanes points_m;
  double limits_m[kLanes];
  std::size_t points[kLanes];
  std::size_t count = 0;

  void add(const PointLanes& from_m, std::size_t lane, double limit_m, std::size_t point) noexcept {
    points_m.x[count] = from_m.x[lane];
    points_m.y[count] = from_m.y[lane];
    points_m.z[count] = from_m.z[lane];
    limits_m[count] = limit_m;
    points[count++] = point;
  }
};

/// Writes those of the candidates that query_below() asks for, and takes them off.
std::size_t sample_below(const Sampler& sampler, Candidates& near, bool also_unknown,
                         FieldSample* samples) noexcept {
  for (std::size_t lane = near.count; lane < kLanes; ++lane) {
    near.points_m.x[lane] = near.points_m.y[lane] = near.points_m.z[lane] = 0.0;
  }
  Places places;
  sampler.locate_points(near.points_m, places);
  alignas(64) double distances_m[kLanes];
  alignas(64) Coordinates gradients;
  sampler.interpolate_at(places, near.count, distances_m, gradients);
  std::size_t written = 0;
  for (std::size_t lane = 0; lane < near.count; ++lane) {
    const FieldStatus status = sampler.status(places, lane);
    const bool counts =
        status == FieldStatus::kOutside || (also_unknown && status == FieldStatus::kUnknown);
    if (!counts && distances_m[lane] >= near.limits_m[lane]) continue;
    samples[written++] = {near.points[lane], status, distances_m[lane], vector_of(gradients, lane)};
  }
  near.count = 0;
  return written;
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
  return is_known(known_, address_of(voxel.x(), voxel.y(), voxel.z(), block_counts_));
}

void DenseField::query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) const noexcept {
  const Sampler sampler(*this);
  for (std::size_t first = 0; first < points_m.size(); first += kLanes) {
    const std::size_t count = std::min(kLanes, points_m.size() - first);
    Places places;
    sampler.locate_points(pack(points_m, first), places);
    alignas(64) double values_m[kLanes];
    alignas(64) Coordinates slopes;
    sampler.interpolate_at(places, count, values_m, slopes);
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::size_t n = first + lane;
      distances_m[n] = values_m[lane];
      if (!gradients.empty()) gradients[n] = vector_of(slopes, lane);
      if (!statuses.empty()) statuses[n] = sampler.status(places, lane);
    }
  }
}

std::size_t DenseField::query_below(std::span<const PointLanes> points_m,
                                    std::span<const double> limits_m, bool also_unknown,
                                    std::span<FieldSample> samples) const noexcept {
  const Sampler sampler(*this);
  // Within a cell the interpolant lies below the value at the nearest centre by no more than the
  // mean way from there to the eight corners, which is longest in the middle: 1.122 voxels.
  const double slack_m = 1.13 * info().steepest * info().grid.resolution_m;
  std::size_t written = 0;
  Candidates near;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const double far_m = std::max(limits_m[i], 0.0) + slack_m;
    if (!also_unknown && sampler.are_far(points_m[i], far_m)) continue;
    Places places;
    sampler.locate_points(points_m[i], places);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if (sampler.nearest_m(places, lane) >= far_m && places.is_inside(lane) &&
          !(also_unknown && sampler.status(places, lane) == FieldStatus::kUnknown)) {
        continue;
      }
      near.add(points_m[i], lane, limits_m[i], i * kLanes + lane);
      if (near.count < kLanes) continue;
      written += sample_below(sampler, near, also_unknown, samples.data() + written);
    }
  }
  if (near.count > 0)
    written += sample_below(sampler, near, also_unknown, samples.data() + written);
  return written;
}

}  // namespace sidestep
