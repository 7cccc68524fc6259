#include "surface_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// An image is read at most at so many columns and rows of what shows a cylinder.
constexpr int kColumns = 16;
constexpr int kRows = 16;
constexpr std::size_t kCloudPoints = 4096;
constexpr double kNear_m = 0.05;
/// Three standard deviations of a structured-light camera's depth, times depth squared.
constexpr double kNoise_per_m = 0.006;

struct PixelBox {
  int first_u, last_u, first_v, last_v;
};

/// The pixels that may show a cylinder; the whole image where it reaches beside the camera.
PixelBox pixels_of(const CameraIntrinsics& camera, const Transform& T_camera_world,
                   const SearchCylinder& cylinder) {
  double low_u = camera.width_px, high_u = -1.0, low_v = camera.height_px, high_v = -1.0;
  for (int corner = 0; corner < 8; ++corner) {
    const double r = cylinder.radius_m;
    const Eigen::Vector3d p =
        T_camera_world * Eigen::Vector3d(cylinder.axis_m.x() + ((corner & 1) != 0 ? r : -r),
                                         cylinder.axis_m.y() + ((corner & 2) != 0 ? r : -r),
                                         (corner & 4) != 0 ? cylinder.top_m : cylinder.bottom_m);
    if (p.z() < kNear_m) return {0, camera.width_px - 1, 0, camera.height_px - 1};
    const double u = camera.fx_px * p.x() / p.z() + camera.cx_px;
    const double v = camera.fy_px * p.y() / p.z() + camera.cy_px;
    low_u = std::min(low_u, u);
    high_u = std::max(high_u, u);
    low_v = std::min(low_v, v);
    high_v = std::max(high_v, v);
  }
  const auto pixel = [](double at, int size) {
    return static_cast<int>(std::clamp(at, -1.0, static_cast<double>(size)));
  };
  return {std::max(0, pixel(std::ceil(low_u), camera.width_px)),
          std::min(camera.width_px - 1, pixel(std::floor(high_u), camera.width_px)),
          std::max(0, pixel(std::ceil(low_v), camera.height_px)),
          std::min(camera.height_px - 1, pixel(std::floor(high_v), camera.height_px))};
}

/// Behind the camera altogether.
bool is_behind(const Transform& T_world_camera, const SearchCylinder& cylinder) {
  const Eigen::Vector3d forward = T_world_camera.linear().col(2);
  const Eigen::Vector3d eye = T_world_camera.translation();
  const double reach = cylinder.radius_m * forward.head<2>().norm();
  const double ahead = forward.head<2>().dot(cylinder.axis_m - eye.head<2>());
  const double up = std::max(forward.z() * (cylinder.bottom_m - eye.z()),
                             forward.z() * (cylinder.top_m - eye.z()));
  return ahead + up + reach < 0.0;
}

bool holds(const SearchCylinder& cylinder, const Eigen::Vector3d& p) {
  return p.z() >= cylinder.bottom_m && p.z() <= cylinder.top_m &&
         (p.head<2>() - cylinder.axis_m).squaredNorm() <= cylinder.radius_m * cylinder.radius_m;
}

}  // namespace

double find_surface_points(const Frame& frame, const SearchCylinder& cylinder,
                           std::vector<Eigen::Vector3d>& points) {
  points.clear();
  const Transform& T_world_camera = frame.T_world_camera;
  if (const auto* cloud = std::get_if<PointCloud>(&frame.measurement)) {
    const std::size_t step = 1 + cloud->points_m.size() / kCloudPoints;
    for (std::size_t i = 0; i < cloud->points_m.size(); i += step) {
      const Eigen::Vector3f& p_camera = cloud->points_m[i];
      if (!p_camera.allFinite() || p_camera.isZero()) continue;
      const Eigen::Vector3d p = T_world_camera * p_camera.cast<double>();
      if (holds(cylinder, p)) points.push_back(p);
    }
    return 0.0;
  }
  if (is_behind(T_world_camera, cylinder)) return 0.0;
  const auto& image = std::get<DepthImage>(frame.measurement);
  const CameraIntrinsics& camera = image.camera;
  const PixelBox box = pixels_of(camera, T_world_camera.inverse(), cylinder);
  const Eigen::Matrix3d R_world_camera = T_world_camera.linear();
  const Eigen::Vector3d eye_m = T_world_camera.translation();
  const std::size_t width = idx(camera.width_px);
  const int step_u = 1 + (box.last_u - box.first_u) / kColumns;
  const int step_v = 1 + (box.last_v - box.first_v) / kRows;
  for (int v = box.first_v; v <= box.last_v; v += step_v) {
    for (int u = box.first_u; u <= box.last_u; u += step_u) {
      // Rows lie far apart in memory: the next is on its way meanwhile.
      __builtin_prefetch(&image.depth_m[idx(std::min(v + step_v, box.last_v)) * width + idx(u)]);
      const float depth_m = image.at(u, v);
      if (!(depth_m > 0.0F) || !std::isfinite(depth_m)) continue;
      const Eigen::Vector3d p =
          R_world_camera * camera.unproject(u, v, static_cast<double>(depth_m)) + eye_m;
      if (holds(cylinder, p)) points.push_back(p);
    }
  }
  const double distance_m = (cylinder.axis_m - T_world_camera.translation().head<2>()).norm();
  return step_u * distance_m / camera.fx_px;
}

void sample_points(const Frame& frame, std::vector<Eigen::Vector3d>& points) {
  constexpr int kAcross = 40, kDown = 30;
  points.clear();
  const Transform& T_world_camera = frame.T_world_camera;
  if (const auto* cloud = std::get_if<PointCloud>(&frame.measurement)) {
    const std::size_t step = 1 + cloud->points_m.size() / (kAcross * kDown);
    for (std::size_t i = 0; i < cloud->points_m.size(); i += step) {
      const Eigen::Vector3f& p = cloud->points_m[i];
      if (p.allFinite() && !p.isZero()) points.push_back(T_world_camera * p.cast<double>());
    }
    return;
  }
  const auto& image = std::get<DepthImage>(frame.measurement);
  const int step_u = 1 + (image.camera.width_px - 1) / kAcross;
  const int step_v = 1 + (image.camera.height_px - 1) / kDown;
  for (int v = step_v / 2; v < image.camera.height_px; v += step_v) {
    for (int u = step_u / 2; u < image.camera.width_px; u += step_u) {
      const float depth_m = image.at(u, v);
      if (!(depth_m > 0.0F) || !std::isfinite(depth_m)) continue;
      points.push_back(T_world_camera * image.camera.unproject(u, v, static_cast<double>(depth_m)));
    }
  }
}

double depth_noise_m(double depth_m) { return kNoise_per_m * depth_m * depth_m; }

SeeThrough::SeeThrough(const Frame& frame)
    : image_(std::get_if<DepthImage>(&frame.measurement)),
      T_camera_world_(frame.T_world_camera.inverse()) {}

SeeThrough::Answer SeeThrough::operator()(const Eigen::Vector3d& p_world, double edge_m,
                                          int rays) const {
  const Eigen::Vector3d p = T_camera_world_ * p_world;
  if (image_ == nullptr || p.z() < edge_m + kNear_m) return Answer::kNo;
  const CameraIntrinsics& camera = image_->camera;
  const double u = camera.fx_px * p.x() / p.z() + camera.cx_px + 0.5;
  const double v = camera.fy_px * p.y() / p.z() + camera.cy_px + 0.5;
  const double apart_px = edge_m * camera.fx_px / p.z() / (rays - 1);
  const double first_px = -0.5 * apart_px * (rays - 1);
  const double behind_m = p.z() + edge_m + depth_noise_m(p.z());
  const double before_m = p.z() - edge_m, after_m = p.z() + edge_m;
  // Pixels along an axis of the image; -1 beside it.
  std::array<int, kMostRays> columns, rows;
  for (int i = 0; i < rays; ++i) {
    const double column = u + first_px + i * apart_px, row = v + first_px + i * apart_px;
    columns[idx(i)] = column >= 0.0 && column < camera.width_px ? static_cast<int>(column) : -1;
    rows[idx(i)] = row >= 0.0 && row < camera.height_px ? static_cast<int>(row) : -1;
  }
  bool is_any_behind = false, is_any_near = false, is_any_in = false, is_all = true;
  for (int j = 0; j < rays; ++j) {
    for (int i = 0; i < rays; ++i) {
      if (columns[idx(i)] < 0 || rows[idx(j)] < 0) {
        is_all = false;
        continue;
      }
      const double depth_m = image_->at(columns[idx(i)], rows[idx(j)]);
      if (!(depth_m > 0.0) || !std::isfinite(depth_m)) continue;
      const bool is_behind = depth_m >= behind_m;
      is_any_behind |= is_behind;
      is_any_near |= !is_behind && depth_m >= before_m;
      is_any_in |= depth_m >= before_m && depth_m <= after_m;
      is_all &= is_behind;
    }
    if (!is_all && is_any_behind) return Answer::kPartly;
  }
  if (is_all && is_any_behind) return Answer::kYes;
  if (is_any_in) return Answer::kHit;
  return is_any_near ? Answer::kPartly : Answer::kNo;
}

}  // namespace sidestep
