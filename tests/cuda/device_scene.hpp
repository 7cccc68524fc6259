#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "log_odds_map.hpp"

/// Frames for a device, made of nothing but numbers.
namespace sidestep::cuda_checks {

/// A map's settings with the default sensor model of the mapper voxel_grid.
inline voxel_grid_cuda::MapSettings map_settings(const cuda::Extent& size) {
  return {size, {850, -400, -1200, 1500, 0}};
}

/// A camera at a place of the grid that looks along x, before walls and boxes at depths that change
/// from frame to frame.
class DeviceScene {
 public:
  DeviceScene(const cuda::Extent& size, double resolution_m, int width_px, int height_px)
      : size_(size), resolution_m_(resolution_m), width_(width_px), height_(height_px) {}

  /// Valid until the next call.
  [[nodiscard]] voxel_grid_cuda::ImageFrame image(int number) {
    fill(number);
    voxel_grid_cuda::ImageFrame frame;
    frame.depth_m = depth_m_;
    const double focal = focal_px(), cx = 0.5 * width_, cy = 0.5 * height_;
    voxel_grid_cuda::View& view = frame.view;
    view.width_px = width_;
    view.height_px = height_;
    view.near_m = 0.01;
    view.margin_px_m[0] = view.margin_px_m[1] = static_cast<float>(0.5 * resolution_m_ * focal);
    view.band_m = static_cast<float>(0.5 * resolution_m_);
    view.depth_slack_m = 1e-4F;
    view.pixel_slack = 1;
    view.first_surface_layer = 1;
    // The camera's axes: right is -y, down is -z, forward is x.
    const double axes[3][3] = {{cx + 0.5, cy + 0.5, 1.0}, {-focal, 0.0, 0.0}, {0.0, -focal, 0.0}};
    const auto eye = eye_vox(number);
    const double from[3] = {0.5 - eye.x, 0.5 - eye.y, 0.5 - eye.z};
    for (int c = 0; c < 3; ++c) {
      for (int axis = 0; axis < 3; ++axis) {
        view.columns[axis][c] = axes[axis][c] * resolution_m_;
        view.base[c] += view.columns[axis][c] * from[axis];
      }
    }
    frame.rules = {0.04F, static_cast<float>(farthest_m()), 1.2F, view.band_m, true};
    frame.x_first = static_cast<float>(-cx / focal);
    frame.x_step = static_cast<float>(1.0 / focal);
    frame.start_vox[0] = static_cast<float>(eye.x);
    frame.start_vox[1] = static_cast<float>(eye.y);
    frame.start_vox[2] = static_cast<float>(eye.z);
    const auto per_m = static_cast<float>(1.0 / resolution_m_);
    frame.across_vox[1] = -per_m;
    lines_.resize(static_cast<std::size_t>(height_));
    for (int v = 0; v < height_; ++v) {
      const auto y = static_cast<float>((v - cy) / focal);
      lines_[static_cast<std::size_t>(v)] = {y, {per_m, 0.0F, -per_m * y}};
    }
    frame.lines = lines_;
    balls_ = {
        {{0.1F, 0.1F, static_cast<float>(0.5 * wall_m())}, 0.3F, 0, 0, width_ - 1, height_ - 1}};
    frame.balls = balls_;
    return frame;
  }

  /// The same points as a cloud.
  [[nodiscard]] voxel_grid_cuda::RayFrame cloud(int number) {
    fill(number);
    points_.clear();
    for (int v = 0; v < height_; ++v) {
      for (int u = 0; u < width_; ++u) {
        const auto d = static_cast<double>(depth_m_[static_cast<std::size_t>(u + width_ * v)]);
        points_.push_back({static_cast<float>((u - 0.5 * width_) / focal_px() * d),
                           static_cast<float>((v - 0.5 * height_) / focal_px() * d),
                           static_cast<float>(d)});
      }
    }
    voxel_grid_cuda::RayFrame frame;
    frame.cloud = points_;
    frame.limits = {0.2, farthest_m(), 1.2 * resolution_m_, true};
    const auto eye = eye_vox(number);
    const double at[3] = {eye.x * resolution_m_, eye.y * resolution_m_, eye.z * resolution_m_};
    const double axes[3][3] = {{0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
    for (int row = 0; row < 3; ++row) {
      for (int c = 0; c < 3; ++c) frame.T_world_camera[row][c] = axes[row][c];
      frame.T_world_camera[row][3] = at[row];
    }
    frame.camera_vox = eye;
    frame.resolution_m = resolution_m_;
    const voxel_grid_cuda::Point ball{at[0] + 0.5 * wall_m(), at[1] - 0.1, at[2] - 0.1};
    world_balls_ = {{ball, 0.3}};
    frame.balls = world_balls_;
    frame.balls_lower_m = {ball.x - 0.3, ball.y - 0.3, ball.z - 0.3};
    frame.balls_upper_m = {ball.x + 0.3, ball.y + 0.3, ball.z + 0.3};
    return frame;
  }

 private:
  [[nodiscard]] double wall_m() const { return 0.6 * size_.x * resolution_m_; }
  /// So that the image's corners see beyond it.
  [[nodiscard]] double farthest_m() const { return 1.15 * wall_m(); }
  [[nodiscard]] double focal_px() const { return 585.0 * width_ / 640.0; }
  [[nodiscard]] voxel_grid_cuda::Point eye_vox(int number) const {
    return {0.1 * size_.x, 0.27 * size_.y + 1.3 * number, 0.45 * size_.z};
  }
  /// A wall with a wave, boxes before it, noise, and pixels without a measurement.
  void fill(int number) {
    std::mt19937 random(static_cast<unsigned>(number) + 1U);
    depth_m_.clear();
    for (int v = 0; v < height_; ++v) {
      for (int u = 0; u < width_; ++u) {
        double d = wall_m() + 0.1 * std::sin(0.05 * u + number);
        const int box = (u * 8 / width_ + number) % 5;
        if (box == 1 && v > height_ / 3) d *= 0.5;
        if (box == 3 && v > height_ / 2) d *= 0.3 + 0.2 * v / height_;
        d += 0.001 * static_cast<double>(random() % 10);
        if (random() % 50 == 0) d = 0.0;
        depth_m_.push_back(static_cast<float>(d));
      }
    }
  }

  cuda::Extent size_;
  double resolution_m_;
  int width_, height_;
  std::vector<float> depth_m_;
  std::vector<voxel_grid_cuda::PixelLine> lines_;
  std::vector<voxel_grid_cuda::Ball> balls_;
  std::vector<voxel_grid_cuda::WorldBall> world_balls_;
  std::vector<voxel_grid_cuda::CloudPoint> points_;
};

}  // namespace sidestep::cuda_checks
