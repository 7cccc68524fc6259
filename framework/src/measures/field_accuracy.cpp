#include <sidestep/measures/field_accuracy.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <sidestep/measures/exact_transform.hpp>

namespace sidestep {

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
