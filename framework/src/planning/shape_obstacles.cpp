#include <sidestep/planning/shape_obstacles.hpp>

namespace sidestep {

std::vector<Eigen::Vector3d> occupied_centres(const DistanceField& field, Space unknown) {
  const GridSpec& grid = field.info().grid;
  const double half_m = 0.5 * grid.resolution_m;
  const auto count = static_cast<std::size_t>(grid.size_vox.x());
  std::vector<Eigen::Vector3d> row(count);
  std::vector<double> distances_m(count);
  std::vector<FieldStatus> statuses(count);
  std::vector<Eigen::Vector3d> centres;
  for (int k = 0; k < grid.size_vox.z(); ++k) {
    for (int j = 0; j < grid.size_vox.y(); ++j) {
      for (std::size_t i = 0; i < count; ++i) row[i] = grid.centre_m({static_cast<int>(i), j, k});
      field.query(row, distances_m, {}, statuses);
      for (std::size_t i = 0; i < count; ++i) {
        const bool is_occupied = statuses[i] == FieldStatus::kUnknown ? unknown == Space::kOccupied
                                                                      : distances_m[i] < half_m;
        if (is_occupied) centres.push_back(row[i]);
      }
    }
  }
  return centres;
}

}  // namespace sidestep
