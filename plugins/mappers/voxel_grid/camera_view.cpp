#include "camera_view.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep::voxel_grid {

GridView view_of_grid(const Frame& frame, const CameraIntrinsics& camera, const GridSpec& grid,
                      float band_m) {
  Eigen::Matrix3d pixels;
  // Half a pixel on top, so that rounding down finds the pixel whose centre is nearest.
  pixels << camera.fx_px, 0.0, camera.cx_px + 0.5, 0.0, camera.fy_px, camera.cy_px + 0.5, 0.0, 0.0,
      1.0;
  const Eigen::Matrix3d to_pixels = pixels * frame.T_world_camera.linear().transpose();
  GridView view;
  view.columns = to_pixels * grid.resolution_m;
  view.base =
      to_pixels * (grid.centre_m(Eigen::Vector3i::Zero()) - frame.T_world_camera.translation());
  Projection& projection = view.projection;
  projection.width_px = camera.width_px;
  projection.width = static_cast<float>(camera.width_px);
  projection.height = static_cast<float>(camera.height_px);
  projection.near_m = static_cast<float>(kNear_m);
  projection.margin_px_m[0] = static_cast<float>(0.5 * grid.resolution_m * camera.fx_px);
  projection.margin_px_m[1] = static_cast<float>(0.5 * grid.resolution_m * camera.fy_px);
  projection.band_m = band_m;
  for (int axis = 0; axis < 3; ++axis) {
    for (int c = 0; c < 3; ++c) {
      projection.column[axis][c] = static_cast<float>(view.columns(c, axis));
    }
  }
  return view;
}

float band_m(const VoxelGridOptions& options) {
  return static_cast<float>(options.surface_band_vox * options.resolution_m);
}

int first_surface_layer(const VoxelGridOptions& options) {
  const double layer =
      (options.rules().floor_top_m() - options.origin_m.z()) / options.resolution_m - 0.5;
  return static_cast<int>(
      std::ceil(std::clamp(layer, -1.0, static_cast<double>(options.size_vox.z()))));
}

PixelRules pixel_rules(const GridSpec& grid, const PointRules& rules, bool clear_no_return,
                       float band_m) {
  PixelRules pixels;
  pixels.min_range_sq = static_cast<float>(rules.min_range_m * rules.min_range_m);
  pixels.max_range_m = static_cast<float>(rules.max_range_m);
  pixels.floor_top_vox =
      static_cast<float>((rules.floor_top_m() - grid.origin_m.z()) / grid.resolution_m);
  pixels.band_m = band_m;
  pixels.clear_no_return = clear_no_return;
  for (int c = 0; c < 3; ++c) pixels.size_vox[c] = static_cast<float>(grid.size_vox[c]);
  return pixels;
}

PixelRays::PixelRays(const Frame& frame, const CameraIntrinsics& camera, const GridSpec& grid)
    : camera_(camera),
      rotation_vox_(frame.T_world_camera.linear() / grid.resolution_m),
      start_vox_((frame.T_world_camera.translation() - grid.origin_m) / grid.resolution_m) {}

PixelRow PixelRays::row(int v) const {
  PixelRow row;
  row.x_first = static_cast<float>(-camera_.cx_px / camera_.fx_px);
  row.x_step = static_cast<float>(1.0 / camera_.fx_px);
  const double y = (v - camera_.cy_px) / camera_.fy_px;
  row.y = static_cast<float>(y);
  for (int c = 0; c < 3; ++c) {
    row.start_vox[c] = static_cast<float>(start_vox_[c]);
    row.across_vox[c] = static_cast<float>(rotation_vox_(c, 0));
    row.along_vox[c] = static_cast<float>(rotation_vox_(c, 1) * y + rotation_vox_(c, 2));
  }
  return row;
}

std::vector<CameraBall> balls_in_view(const Frame& frame, const CameraIntrinsics& camera,
                                      const SelfFilter& self) {
  std::vector<CameraBall> balls;
  const Transform T_camera_world = frame.T_world_camera.inverse();
  for (const SelfFilter::Ball& ball : self.balls()) {
    const Eigen::Vector3d centre_m = T_camera_world * ball.centre_m;
    const double r = ball.radius_m;
    if (centre_m.z() + r <= 0.0) continue;
    CameraBall seen{{}, static_cast<float>(r), 0, 0, camera.width_px - 1, camera.height_px - 1};
    for (int c = 0; c < 3; ++c) seen.centre_m[c] = static_cast<float>(centre_m[c]);
    const double nearest_m = centre_m.z() - r;
    if (nearest_m > 1e-3) {
      // The image of the cube around the ball: extremes lie at its near or far face.
      const auto range = [&](double c, double focal_px, double principal_px, int last, int& low,
                             int& high) {
        const double least = (c - r) / (c - r < 0.0 ? nearest_m : centre_m.z() + r);
        const double most = (c + r) / (c + r > 0.0 ? nearest_m : centre_m.z() + r);
        low = static_cast<int>(std::clamp(std::floor(focal_px * least + principal_px), 0.0,
                                          static_cast<double>(last) + 1.0));
        high = static_cast<int>(
            std::clamp(std::ceil(focal_px * most + principal_px), -1.0, static_cast<double>(last)));
      };
      range(centre_m.x(), camera.fx_px, camera.cx_px, camera.width_px - 1, seen.u0, seen.u1);
      range(centre_m.y(), camera.fy_px, camera.cy_px, camera.height_px - 1, seen.v0, seen.v1);
    }
    if (seen.u0 <= seen.u1 && seen.v0 <= seen.v1) balls.push_back(seen);
  }
  return balls;
}

}  // namespace sidestep::voxel_grid
