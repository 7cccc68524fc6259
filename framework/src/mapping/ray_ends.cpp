#include <sidestep/mapping/ray_ends.hpp>

#include <algorithm>

namespace sidestep {

std::optional<LinePart> clip_to_box(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                    const Eigen::Vector3d& size) {
  LinePart part;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = to[axis] - from[axis];
    if (along == 0.0) {
      if (from[axis] < 0.0 || from[axis] >= size[axis]) return std::nullopt;
      continue;
    }
    const double a = -from[axis] / along;
    const double b = (size[axis] - from[axis]) / along;
    part.enter = std::max(part.enter, std::min(a, b));
    part.leave = std::min(part.leave, std::max(a, b));
  }
  if (part.enter >= part.leave) return std::nullopt;
  return part;
}

Eigen::Vector3i nearest_voxel(const GridSpec& grid, const Eigen::Vector3d& p_vox) {
  const Eigen::Array3d last = grid.size_vox.cast<double>().array() - 1.0;
  return p_vox.array().floor().max(0.0).min(last).cast<int>().matrix();
}

RayEnds::RayEnds(const GridSpec& grid, const PointRules& rules, bool clear_no_return,
                 const SelfFilter& self, const Frame& frame)
    : grid_(grid), rules_(rules), clear_no_return_(clear_no_return), self_(self), frame_(frame) {}

std::size_t RayEnds::size() const noexcept {
  const auto* image = std::get_if<DepthImage>(&frame_.measurement);
  return image != nullptr ? image->depth_m.size()
                          : std::get_if<PointCloud>(&frame_.measurement)->points_m.size();
}

Eigen::Vector3d RayEnds::to_vox(const Eigen::Vector3d& p_world) const {
  return (p_world - grid_.origin_m) / grid_.resolution_m;
}

Eigen::Vector3d RayEnds::camera_vox() const { return to_vox(frame_.T_world_camera.translation()); }

std::optional<RayEnd> RayEnds::at(std::size_t index, IntegrationCounts& counts) const {
  const auto* image = std::get_if<DepthImage>(&frame_.measurement);
  if (image == nullptr) {
    const PointCloud& cloud = *std::get_if<PointCloud>(&frame_.measurement);
    return of_point(cloud.points_m[index].cast<double>(), counts);
  }
  const CameraIntrinsics& camera = image->camera;
  const std::size_t width = static_cast<std::size_t>(camera.width_px);
  const double u = static_cast<double>(index % width);
  const std::size_t row = index / width;
  const double v = static_cast<double>(row);
  const float depth_m = image->depth_m[index];
  if (depth_m > 0.0F) {
    return of_point(camera.unproject(u, v, static_cast<double>(depth_m)), counts);
  }
  ++counts.invalid;
  if (!clear_no_return_ || depth_m != 0.0F) return std::nullopt;
  const Eigen::Vector3d ray = camera.unproject(u, v, 1.0).normalized();
  return free_to(frame_.T_world_camera * Eigen::Vector3d(ray * rules_.max_range_m));
}

std::optional<RayEnd> RayEnds::of_point(const Eigen::Vector3d& p_camera,
                                        IntegrationCounts& counts) const {
  const Eigen::Vector3d p_world = frame_.T_world_camera * p_camera;
  const PointFate fate = rules_.fate(p_camera, p_world);
  if (fate == PointFate::kInvalid) {
    ++counts.invalid;
    return std::nullopt;
  }
  ++counts.points;
  if (self_.contains(p_world)) {
    ++counts.self;
    return std::nullopt;
  }
  if (fate == PointFate::kFloor) {
    ++counts.floor;
    return free_to(p_world);
  }
  const Eigen::Vector3d& eye_world = frame_.T_world_camera.translation();
  if (fate == PointFate::kOutOfRange) {
    ++counts.out_of_range;
    return free_to(eye_world + rules_.max_range_m / p_camera.norm() * (p_world - eye_world));
  }
  const Eigen::Vector3d p_vox = to_vox(p_world);
  if ((p_vox.array() >= 0.0).all() &&
      (p_vox.array() < grid_.size_vox.cast<double>().array()).all()) {
    ++counts.inserted;
    return RayEnd{p_vox, true};
  }
  ++counts.outside_grid;
  return free_to(p_world);
}

std::optional<RayEnd> RayEnds::free_to(const Eigen::Vector3d& p_world) const {
  const Eigen::Vector3d from = camera_vox();
  const Eigen::Vector3d to = to_vox(p_world);
  const auto part = clip_to_box(from, to, grid_.size_vox.cast<double>());
  if (!part) return std::nullopt;
  return RayEnd{from + part->leave * (to - from), false};
}

void add_counts(IntegrationCounts& to, const IntegrationCounts& more) noexcept {
  to.points += more.points;
  to.inserted += more.inserted;
  to.floor += more.floor;
  to.self += more.self;
  to.out_of_range += more.out_of_range;
  to.outside_grid += more.outside_grid;
  to.invalid += more.invalid;
}

}  // namespace sidestep
