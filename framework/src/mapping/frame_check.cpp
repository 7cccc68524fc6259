#include <sidestep/mapping/frame_check.hpp>

#include <cmath>
#include <string>

namespace sidestep {
namespace {

constexpr double kRigidTolerance = 1e-3;

const char* pose_fault(const Transform& pose) {
  if (!pose.matrix().allFinite()) return "its camera pose is not finite";
  const Eigen::Matrix3d rotation = pose.linear();
  const double skew =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (skew > kRigidTolerance)
    return "its camera pose is not rigid: the rotation is not orthonormal";
  if (rotation.determinant() < 0.0) return "its camera pose is not rigid: it mirrors";
  return nullptr;
}

std::string image_fault(const DepthImage& image) {
  const CameraIntrinsics& camera = image.camera;
  const std::string size =
      std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px);
  if (camera.width_px <= 0 || camera.height_px <= 0) {
    return "its depth image is " + size + " pixels";
  }
  for (const double focal_px : {camera.fx_px, camera.fy_px}) {
    if (!std::isfinite(focal_px) || focal_px <= 0.0) {
      return "its focal length is " + std::to_string(focal_px) + " px";
    }
  }
  if (!std::isfinite(camera.cx_px) || !std::isfinite(camera.cy_px)) {
    return "its principal point is not finite";
  }
  const std::size_t pixels =
      static_cast<std::size_t>(camera.width_px) * static_cast<std::size_t>(camera.height_px);
  if (image.depth_m.size() != pixels) {
    return "it has " + std::to_string(image.depth_m.size()) + " depths for a camera of " + size +
           " pixels";
  }
  return {};
}

}  // namespace

Error bad_frame(const Frame& frame, std::string message, std::string hint) {
  return Error{ErrorCode::kBadFrame, std::move(message), "frame " + std::to_string(frame.sequence),
               std::move(hint), nullptr};
}

Result<void> check_frame(const Frame& frame) {
  if (const char* fault = pose_fault(frame.T_world_camera)) {
    return tl::make_unexpected(bad_frame(frame, fault));
  }
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    std::string fault = image_fault(*image);
    if (!fault.empty()) return tl::make_unexpected(bad_frame(frame, std::move(fault)));
  }
  return {};
}

}  // namespace sidestep
