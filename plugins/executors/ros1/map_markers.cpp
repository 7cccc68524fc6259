#include "map_markers.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep::ros1_executor {
namespace {

using ros_messages::Marker;
using ros_messages::MarkerArray;
using Colour = decltype(Marker::color);

/// From red (0) over yellow, green and cyan to blue (1).
Colour rainbow(double share, float alpha) {
  const double x = 4.0 * std::clamp(share, 0.0, 1.0);
  const auto ramp = [](double value) { return static_cast<float>(std::clamp(value, 0.0, 1.0)); };
  Colour colour;
  colour.r = ramp(2.0 - x);
  colour.g = ramp(std::min(x, 4.0 - x));
  colour.b = ramp(x - 2.0);
  colour.a = alpha;
  return colour;
}

/// An array that removes all that its topic showed, and one list of boxes.
MarkerArray boxes(const std::string& group, const std::string& frame, ::ros::Time stamp,
                  const Eigen::Vector3d& size_m) {
  MarkerArray array;
  Marker& all = array.markers.emplace_back();
  all.header.frame_id = frame;
  all.header.stamp = stamp;
  all.action = Marker::DELETEALL;
  Marker& list = array.markers.emplace_back(all);
  list.ns = group;
  list.type = Marker::CUBE_LIST;
  list.action = Marker::ADD;
  list.pose.orientation.w = 1.0;
  list.scale.x = size_m.x();
  list.scale.y = size_m.y();
  list.scale.z = size_m.z();
  list.color.a = 1.0F;
  return array;
}

void add(Marker& list, const Eigen::Vector3d& centre_m, const Colour& colour) {
  auto& point = list.points.emplace_back();
  point.x = centre_m.x();
  point.y = centre_m.y();
  point.z = centre_m.z();
  list.colors.push_back(colour);
}

/// RViz takes a list of none for a mistake.
MarkerArray without_empty(MarkerArray array) {
  if (array.markers.back().points.empty()) array.markers.pop_back();
  return array;
}

}  // namespace

MarkerArray voxel_markers(const OccupancyBits& voxels, const std::string& frame,
                          ::ros::Time stamp) {
  const GridSpec& grid = voxels.grid();
  MarkerArray array = boxes("occupied", frame, stamp, Eigen::Vector3d::Constant(grid.resolution_m));
  const double bottom_m = grid.origin_m.z();
  const double height_m = std::max(1, grid.size_vox.z()) * grid.resolution_m;
  for (const Eigen::Vector3d& centre_m : voxels.occupied_centres_m()) {
    add(array.markers.back(), centre_m, rainbow((centre_m.z() - bottom_m) / height_m, 1.0F));
  }
  return without_empty(std::move(array));
}

MarkerArray slice_markers(const DistanceField& field, double height_m, const std::string& frame,
                          ::ros::Time stamp) {
  const GridSpec& grid = field.info().grid;
  const int largest = std::max(grid.size_vox.x(), grid.size_vox.y());
  const int stride = std::max(1, (largest + kMostSliceSquares - 1) / kMostSliceSquares);
  const double side_m = stride * grid.resolution_m;
  constexpr double kThick_m = 0.002;
  MarkerArray array = boxes("field", frame, stamp, {side_m, side_m, kThick_m});
  if (grid.size_vox.minCoeff() < 1) return without_empty(std::move(array));
  const double top_m = grid.centre_m(grid.size_vox - Eigen::Vector3i::Ones()).z();
  const double bottom_m = grid.centre_m(Eigen::Vector3i::Zero()).z();
  const double z_m = std::clamp(height_m, bottom_m, top_m);
  constexpr double kFar_m = 1.0;
  const double max_m = std::min(field.info().max_distance_m, kFar_m);

  const auto columns = static_cast<std::size_t>((grid.size_vox.x() + stride - 1) / stride);
  std::vector<Eigen::Vector3d> points_m(columns);
  std::vector<double> distances_m(columns);
  std::vector<FieldStatus> statuses(columns);
  for (int y = 0; y < grid.size_vox.y(); y += stride) {
    for (std::size_t c = 0; c < columns; ++c) {
      points_m[c] = grid.centre_m({static_cast<int>(c) * stride, y, 0});
      points_m[c].z() = z_m;
    }
    field.query(points_m, distances_m, {}, statuses);
    for (std::size_t c = 0; c < columns; ++c) {
      if (statuses[c] != FieldStatus::kKnown || std::isnan(distances_m[c])) continue;
      add(array.markers.back(), points_m[c], rainbow(distances_m[c] / max_m, 0.6F));
    }
  }
  return without_empty(std::move(array));
}

}  // namespace sidestep::ros1_executor
