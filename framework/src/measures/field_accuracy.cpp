#include <sidestep/measures/field_accuracy.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace sidestep {
namespace {

/// Squared distances in voxels, or a number too large to matter.
using Squares = std::vector<std::int32_t>;

/// One axis of the transform: lines of `count` values, `stride` apart, `width` of them side by
/// side from `from` on.
struct Lines {
  std::size_t from = 0;
  std::size_t width = 0;
  std::size_t stride = 0;
  int count = 0;
};

/// to[i] = min over |o| <= reach of from[i + o] + o^2, along every line.
void least_along(const Squares& from, Squares& to, const Lines& lines, int reach) {
  for (int i = 0; i < lines.count; ++i) {
    std::int32_t* out = to.data() + lines.from + static_cast<std::size_t>(i) * lines.stride;
    const int first = std::max(0, i - reach);
    const int last = std::min(lines.count - 1, i + reach);
    for (int k = first; k <= last; ++k) {
      const std::int32_t* in =
          from.data() + lines.from + static_cast<std::size_t>(k) * lines.stride;
      const std::int32_t square = (k - i) * (k - i);
      for (std::size_t w = 0; w < lines.width; ++w) out[w] = std::min(out[w], in[w] + square);
    }
  }
}

/// Squared distances along x alone.
Squares along_rows(const GridSpec& grid, const std::vector<std::uint8_t>& is_goal,
                   std::int32_t far) {
  const auto nx = static_cast<std::size_t>(grid.size_vox.x());
  Squares squares(is_goal.size());
  for (std::size_t row = 0; row < is_goal.size(); row += nx) {
    std::int32_t steps = far;
    for (std::size_t x = 0; x < nx; ++x) {
      steps = is_goal[row + x] != 0 ? 0 : std::min(steps + 1, far);
      squares[row + x] = steps;
    }
    steps = far;
    for (std::size_t x = nx; x-- > 0;) {
      steps = is_goal[row + x] != 0 ? 0 : std::min(steps + 1, far);
      const std::int32_t nearest = std::min(steps, squares[row + x]);
      squares[row + x] = nearest * nearest;
    }
  }
  return squares;
}

/// Squared distance from every voxel to the nearest goal, exact up to `reach` voxels.
Squares squared_distances(const GridSpec& grid, const std::vector<std::uint8_t>& is_goal,
                          int reach) {
  const auto nx = static_cast<std::size_t>(grid.size_vox.x());
  const auto plane = nx * static_cast<std::size_t>(grid.size_vox.y());
  const std::int32_t beyond = (reach + 1) * (reach + 1);
  Squares from = along_rows(grid, is_goal, reach + 1);
  Squares to(from.size(), beyond);
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    least_along(from, to, {static_cast<std::size_t>(z) * plane, nx, nx, grid.size_vox.y()}, reach);
  }
  std::ranges::fill(from, beyond);
  for (int y = 0; y < grid.size_vox.y(); ++y) {
    least_along(to, from, {static_cast<std::size_t>(y) * nx, nx, plane, grid.size_vox.z()}, reach);
  }
  return from;
}

}  // namespace

std::vector<float> exact_distances_m(const GridSpec& grid,
                                     const std::vector<std::uint8_t>& obstacles,
                                     double max_distance_m, bool is_signed) {
  const int reach = static_cast<int>(std::ceil(max_distance_m / grid.resolution_m));
  const auto metres = [&](std::int32_t square) {
    return static_cast<float>(
        std::min(max_distance_m, grid.resolution_m * std::sqrt(static_cast<double>(square))));
  };
  std::vector<float> distances_m(obstacles.size());
  {
    const Squares outside = squared_distances(grid, obstacles, reach);
    std::ranges::transform(outside, distances_m.begin(), metres);
  }
  if (!is_signed) return distances_m;
  std::vector<std::uint8_t> is_free(obstacles.size());
  std::ranges::transform(obstacles, is_free.begin(),
                         [](std::uint8_t value) { return static_cast<std::uint8_t>(value == 0); });
  const Squares inside = squared_distances(grid, is_free, reach);
  for (std::size_t i = 0; i < inside.size(); ++i) {
    if (obstacles[i] != 0) distances_m[i] = -metres(inside[i]);
  }
  return distances_m;
}

std::vector<std::uint8_t> obstacles_of(const OccupancyView& map, bool unknown_occupied) {
  const GridSpec& grid = map.occupancy_grid();
  const VoxelBits occupied = map.occupied();
  const VoxelBits known = map.known();
  std::vector<std::uint8_t> obstacles(grid.voxel_count());
  std::size_t i = 0;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        const Eigen::Vector3i voxel(x, y, z);
        const bool is_obstacle =
            occupied.at(grid, voxel) || (unknown_occupied && !known.at(grid, voxel));
        obstacles[i++] = is_obstacle ? 1 : 0;
      }
    }
  }
  return obstacles;
}

void FieldAccuracy::add(const FieldAccuracy& other) noexcept {
  compared_vox += other.compared_vox;
  differing_vox += other.differing_vox;
  max_error_m = std::max(max_error_m, other.max_error_m);
  sum_error_m += other.sum_error_m;
}

FieldAccuracy compare_with_exact(const DistanceField& field, const OccupancyView& map,
                                 double max_distance_m, bool unknown_occupied) {
  const GridSpec& grid = map.occupancy_grid();
  const std::vector<float> exact_m = exact_distances_m(grid, obstacles_of(map, unknown_occupied),
                                                       max_distance_m, field.info().is_signed);
  const auto row_length = static_cast<std::size_t>(grid.size_vox.x());
  std::vector<Eigen::Vector3d> centres(row_length);
  std::vector<double> distances_m(row_length);
  std::vector<FieldStatus> statuses(row_length);
  FieldAccuracy accuracy;
  std::size_t row = 0;
  for (int z = 0; z < grid.size_vox.z(); ++z) {
    for (int y = 0; y < grid.size_vox.y(); ++y, row += row_length) {
      for (int x = 0; x < grid.size_vox.x(); ++x) {
        centres[static_cast<std::size_t>(x)] = grid.centre_m({x, y, z});
      }
      field.query(centres, distances_m, {}, statuses);
      for (std::size_t x = 0; x < row_length; ++x) {
        if (statuses[x] != FieldStatus::kKnown) continue;
        const double exact = exact_m[row + x];
        double error_m = std::numeric_limits<double>::infinity();
        if (std::isfinite(distances_m[x])) {
          error_m = std::abs(std::clamp(distances_m[x], -max_distance_m, max_distance_m) - exact);
        }
        const bool exactly_far = std::abs(exact) >= max_distance_m - FieldAccuracy::kSame_m;
        if (exactly_far && error_m <= FieldAccuracy::kSame_m) continue;
        ++accuracy.compared_vox;
        accuracy.differing_vox += error_m > FieldAccuracy::kSame_m ? 1 : 0;
        accuracy.max_error_m = std::max(accuracy.max_error_m, error_m);
        accuracy.sum_error_m += error_m;
      }
    }
  }
  return accuracy;
}

}  // namespace sidestep
