#include "field_slice.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

std::int16_t millimetres(double distance_m, FieldStatus status) noexcept {
  if (status != FieldStatus::kKnown || std::isnan(distance_m)) return FieldSlice::kUnknown;
  return static_cast<std::int16_t>(std::lround(std::clamp(1e3 * distance_m, -32767.0, 32767.0)));
}

}  // namespace

FieldSlice make_slice(const DistanceField& field, const SliceRequest& request) {
  const GridSpec& grid = field.info().grid;
  const int axis = request.axis;
  const int across = axis == 0 ? 1 : 0;
  const int down = axis == 2 ? 1 : 2;
  FieldSlice slice;
  slice.request = request;
  slice.first_m = grid.centre_m(Eigen::Vector3i::Zero());
  slice.request.position_m = std::clamp(
      request.position_m, slice.first_m[axis],
      std::max(slice.first_m[axis], grid.centre_m(grid.size_vox)[axis] - grid.resolution_m));
  slice.first_m[axis] = slice.request.position_m;
  slice.max_distance_m = std::min(field.info().max_distance_m, 32.767);

  const int largest = std::max(grid.size_vox[across], grid.size_vox[down]);
  const int stride = (largest + FieldSlice::kMostSamples - 1) / FieldSlice::kMostSamples;
  if (stride == 0) return slice;
  slice.step_m = stride * grid.resolution_m;
  slice.columns = (grid.size_vox[across] + stride - 1) / stride;
  slice.rows = (grid.size_vox[down] + stride - 1) / stride;

  const auto columns = static_cast<std::size_t>(slice.columns);
  std::vector<Eigen::Vector3d> points_m(columns, slice.first_m);
  std::vector<double> distances_m(columns);
  std::vector<FieldStatus> statuses(columns);
  for (int row = 0; row < slice.rows; ++row) {
    for (std::size_t c = 0; c < columns; ++c) {
      points_m[c][across] = slice.first_m[across] + static_cast<double>(c) * slice.step_m;
      points_m[c][down] = slice.first_m[down] + row * slice.step_m;
    }
    field.query(points_m, distances_m, {}, statuses);
    for (std::size_t c = 0; c < columns; ++c) {
      slice.distance_mm.push_back(millimetres(distances_m[c], statuses[c]));
    }
  }
  return slice;
}

}  // namespace sidestep
