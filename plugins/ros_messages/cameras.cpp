#include <algorithm>
#include <cmath>

#include "conversions.hpp"

namespace sidestep::ros_messages {
namespace {

/// Projection matrices are 3 x 4, row by row; P is all zero where the camera is not calibrated.
constexpr std::size_t kPfx = 0, kPcx = 2, kPfy = 5, kPcy = 6;
constexpr std::size_t kKfx = 0, kKcx = 2, kKfy = 4, kKcy = 5;
constexpr double kLargest_px = 65536.0;

}  // namespace

bool is_distorted(const CameraInfo& info) {
  const bool has_projection = info.P[kPfx] > 0.0;
  return !has_projection && std::ranges::any_of(info.D, [](double d) { return d != 0.0; });
}

Result<CameraIntrinsics> intrinsics(const CameraInfo& info) {
  const bool has_projection = info.P[kPfx] > 0.0;
  CameraIntrinsics camera;
  camera.fx_px = has_projection ? info.P[kPfx] : info.K[kKfx];
  camera.fy_px = has_projection ? info.P[kPfy] : info.K[kKfy];
  camera.cx_px = has_projection ? info.P[kPcx] : info.K[kKcx];
  camera.cy_px = has_projection ? info.P[kPcy] : info.K[kKcy];
  // The matrices are those of the full image; a region of 0 x 0 is the full image.
  const auto& roi = info.roi;
  const double binning_x = std::max(1U, info.binning_x);
  const double binning_y = std::max(1U, info.binning_y);
  const double width = std::floor((roi.width > 0 ? roi.width : info.width) / binning_x);
  const double height = std::floor((roi.height > 0 ? roi.height : info.height) / binning_y);
  camera.fx_px /= binning_x;
  camera.fy_px /= binning_y;
  camera.cx_px = (camera.cx_px - roi.x_offset) / binning_x;
  camera.cy_px = (camera.cy_px - roi.y_offset) / binning_y;
  const bool is_usable = width > 0.0 && width <= kLargest_px && height > 0.0 &&
                         height <= kLargest_px && camera.fx_px > 0.0 && camera.fy_px > 0.0 &&
                         std::isfinite(camera.fx_px) && std::isfinite(camera.fy_px) &&
                         std::isfinite(camera.cx_px) && std::isfinite(camera.cy_px);
  if (!is_usable) {
    return fail(ErrorCode::kBadFrame,
                "the camera info holds no intrinsics: its size or focal length is not positive");
  }
  camera.width_px = static_cast<int>(width);
  camera.height_px = static_cast<int>(height);
  return camera;
}

CameraInfo to_camera_info(const CameraIntrinsics& camera, Stamp stamp, const std::string& frame) {
  CameraInfo info;
  info.header.stamp = to_ros_time(stamp);
  info.header.frame_id = frame;
  info.width = static_cast<std::uint32_t>(camera.width_px);
  info.height = static_cast<std::uint32_t>(camera.height_px);
  info.distortion_model = "plumb_bob";
  info.D.resize(5);
  info.K[kKfx] = info.P[kPfx] = camera.fx_px;
  info.K[kKfy] = info.P[kPfy] = camera.fy_px;
  info.K[kKcx] = info.P[kPcx] = camera.cx_px;
  info.K[kKcy] = info.P[kPcy] = camera.cy_px;
  info.K[8] = info.P[10] = 1.0;
  info.R[0] = info.R[4] = info.R[8] = 1.0;
  return info;
}

}  // namespace sidestep::ros_messages
