#include <sidestep/measures/point_survey.hpp>

#include <algorithm>
#include <cmath>

#include <sidestep/core/format.hpp>

namespace sidestep {
namespace {

constexpr int kSampledColumns = 80;
constexpr int kCoarsest_px = 8;
constexpr std::size_t kEveryPoint = 8;  ///< Of a cloud.
/// No point of a floor at height 0 appears higher than this, by noise or a camera's tilt.
constexpr double kFloor_m = 0.2;

/// As a configuration has it: "[1.5, -2, 0]".
std::string list(const Eigen::Vector3d& values) {
  return "[" + format("%.6g", values.x()) + ", " + format("%.6g", values.y()) + ", " +
         format("%.6g", values.z()) + "]";
}

std::string from_to(const Eigen::Vector3d& lower_m, const Eigen::Vector3d& upper_m) {
  const auto text = [&](const Eigen::Vector3d& p) {
    return "(" + format("%.2f", p.x()) + ", " + format("%.2f", p.y()) + ", " +
           format("%.2f", p.z()) + ")";
  };
  return "from " + text(lower_m) + " to " + text(upper_m) + " m";
}

}  // namespace

PointSurvey PointSurvey::of_mapper(const Node& block) {
  const Node* range = block.find("max_range_m");
  const auto range_m = range != nullptr ? range->as_double() : Result<double>(INFINITY);
  return PointSurvey(range_m && *range_m > 0.0 ? *range_m : INFINITY);
}

void PointSurvey::add(const Frame& frame, const GridSpec& grid) {
  if (const auto* cloud = std::get_if<PointCloud>(&frame.measurement)) {
    for (std::size_t i = 0; i < cloud->points_m.size(); i += kEveryPoint) {
      add_point(cloud->points_m[i].cast<double>(), frame.T_world_camera, grid);
    }
    return;
  }
  const auto& image = *std::get_if<DepthImage>(&frame.measurement);
  const int width = image.camera.width_px;
  const int height = image.camera.height_px;
  if (width <= 0 || height <= 0 ||
      image.depth_m.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    return;
  }
  const int step = std::clamp(width / kSampledColumns, 1, kCoarsest_px);
  for (int v = 0; v < height; v += step) {
    for (int u = 0; u < width; u += step) {
      const auto depth_m = static_cast<double>(image.at(u, v));
      if (depth_m > 0.0) {
        add_point(image.camera.unproject(u, v, depth_m), frame.T_world_camera, grid);
      }
    }
  }
}

void PointSurvey::add_point(const Eigen::Vector3d& p_camera, const Transform& T_world_camera,
                            const GridSpec& grid) {
  const double range_m = p_camera.norm();
  if (!std::isfinite(range_m)) return;
  if (range_m > max_range_m_) {
    nearest_m_ = std::min(nearest_m_, range_m);
    return;
  }
  const Eigen::Vector3d p_world = T_world_camera * p_camera;
  if (!p_world.allFinite()) return;
  box_m_.extend(p_world);
  if ((p_world.array() >= grid.origin_m.array()).all() &&
      (p_world.array() < grid.upper_m().array()).all()) {
    ++in_grid_;
    if (p_world.z() > kFloor_m) ++above_floor_;
  }
}

std::string PointSurvey::emptiness(const OccupancyView& map, Keys keys) const {
  const auto has_any = [](const VoxelBits& bits) {
    return std::ranges::any_of(bits.words, [](std::uint64_t word) { return word != 0; });
  };
  const bool is_floor = reaches_grid() && above_floor_ == 0;
  if (has_any(map.known()) && (has_any(map.occupied()) || is_floor)) return "";
  return describe(map.occupancy_grid(), keys);
}

std::string PointSurvey::describe(const GridSpec& grid, Keys keys) const {
  if (box_m_.isEmpty()) {
    if (!std::isfinite(nearest_m_)) return "no frame has a single valid depth";
    return "every point is farther from the camera than mapper.max_range_m: " +
           format("%g", max_range_m_) + ", the nearest " + format("%.2f m", nearest_m_);
  }
  const double voxel_m = grid.resolution_m;
  const Eigen::Vector3d first = (box_m_.min() / voxel_m).array().floor() - 1.0;
  const Eigen::Vector3d last = (box_m_.max() / voxel_m).array().floor() + 2.0;
  const Eigen::Vector3d size_vox = last - first;
  const std::string held =
      keys == Keys::kMapper
          ? "mapper.origin_m: " + list(voxel_m * first) + " and mapper.size_vox: " + list(size_vox)
          : "experiment.origin_m: " + list(voxel_m * first) +
                " and experiment.extent_m: " + list(voxel_m * size_vox);
  return (reaches_grid() ? "points lie in the map, but it holds none of them (mapper.max_range_m, "
                           "mapper.floor_clearance_m): they lie "
                         : "no point of any frame lies in the map: they lie ") +
         from_to(box_m_.min(), box_m_.max()) + ", the map " +
         from_to(grid.origin_m, grid.upper_m()) + "; " + held + " would hold them";
}

}  // namespace sidestep
