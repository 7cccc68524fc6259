#include <sidestep/mapping/sensor_agreement.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/mapping/frame_check.hpp>

namespace sidestep {
namespace {

constexpr double kApart_s = 0.025;  // who walks has gone 4 cm
constexpr double kGone_s = 1.0;
constexpr double kLevel = 0.9998;        // a cosine, of a degree
constexpr double kBesidePlane_m = 0.03;  // so near to the laser's plane
constexpr double kNearestBeam_m = 0.4;   // of the laser: nearer is the robot
constexpr double kCameraRange_m =
    3.5;                           // of the camera: farther off, its noise is larger than kAgree_m
constexpr double kAgree_m = 0.05;  // along a beam, and this much more of its length
constexpr double kAgree = 0.01;
constexpr int kColumnsRead = 160, kRowsRead = 120;  // samples of an image
constexpr std::size_t kFewestCompared = 55;
constexpr double kTurnStep_rad = 0.00873;  // half a degree
constexpr int kTurnSteps = 18;
constexpr double kAgrees = 0.8, kDisagrees = 0.45;  // shares of the beams that tell

}  // namespace

Result<void> SensorAgreement::check(const Frame& frame) {
  if (!check_frame(frame)) return {};
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  const auto* cloud = std::get_if<PointCloud>(&frame.measurement);
  if (cloud != nullptr && is_planar_scan(*cloud)) take_scan(frame, *cloud);
  if (image != nullptr && !beams_m_.empty()) take_image(frame, *image);
  // A laser that is gone says nothing of a camera.
  if (frame.stamp.seconds() - scan_stamp_.seconds() > kGone_s) verdict_ = {};
  if (!beams_m_.empty() && image_stamp_ &&
      std::abs(image_stamp_->seconds() - scan_stamp_.seconds()) <= kApart_s) {
    verdict_.hear(sign(), frame.stamp);
  }
  if (image == nullptr || !verdict_.is_fault) return {};
  return fail(ErrorCode::kBadFrame,
              format("camera and laser do not agree: what one sees is turned by %.1f degrees "
                     "against the other",
                     std::abs(turn_rad_) * 180.0 / std::numbers::pi),
              {}, "see how both are mounted, head joints and intrinsics");
}

void SensorAgreement::take_scan(const Frame& frame, const PointCloud& scan) {
  beams_m_.clear();
  if (frame.T_world_camera.linear()(2, 2) < kLevel) return;
  // Beams are evenly apart: two that returned tell of all.
  std::optional<std::size_t> first, last;
  const auto angle = [&](std::size_t beam) {
    return std::atan2(static_cast<double>(scan.points_m[beam].y()),
                      static_cast<double>(scan.points_m[beam].x()));
  };
  beams_m_.assign(scan.points_m.size(), 0.0F);
  for (std::size_t beam = 0; beam < beams_m_.size(); ++beam) {
    const Eigen::Vector3f& p = scan.points_m[beam];
    if (!p.allFinite() || p.isZero()) continue;
    beams_m_[beam] = p.norm();
    if (!first) first = beam;
    last = beam;
  }
  if (!first || *first == *last) return beams_m_.clear();
  const auto steps = static_cast<double>(*last - *first);
  double across_rad = angle(*last) - angle(*first);
  if (across_rad < 0.0) across_rad += 2.0 * std::numbers::pi;
  step_rad_ = across_rad / steps;
  first_rad_ = angle(*first) - static_cast<double>(*first) * step_rad_;
  scan_stamp_ = frame.stamp;
  T_world_laser_ = frame.T_world_camera;
}

FaultSign SensorAgreement::sign() {
  find_points();
  const auto as_said = agreement(0.0);
  if (!as_said) return FaultSign::kNothing;
  double best = *as_said, best_rad = 0.0;
  for (int step = 1; step <= kTurnSteps; ++step) {
    const double turn_rad = step * kTurnStep_rad;
    for (const double to_side_rad : {-turn_rad, turn_rad}) {
      const auto turned = agreement(to_side_rad);
      if (!turned || *turned <= best) continue;
      best = *turned;
      best_rad = to_side_rad;
    }
  }
  if (std::abs(best_rad) <= kMaxTurn_rad || *as_said >= kAgrees) return FaultSign::kSound;
  if (best < kAgrees || *as_said > kDisagrees) return FaultSign::kNothing;
  if (!verdict_.is_fault) turn_rad_ = best_rad;
  return FaultSign::kFault;
}

void SensorAgreement::take_image(const Frame& frame, const DepthImage& image) {
  image_stamp_ = frame.stamp;
  camera_world_m_ = frame.T_world_camera.translation();
  image_world_m_.clear();
  const CameraIntrinsics& camera = image.camera;
  for (int v = 0; v < camera.height_px; v += std::max(1, camera.height_px / kRowsRead)) {
    for (int u = 0; u < camera.width_px; u += std::max(1, camera.width_px / kColumnsRead)) {
      const float depth_m = image.at(u, v);
      if (!(depth_m > 0.0F) || !std::isfinite(depth_m)) continue;
      image_world_m_.push_back(frame.T_world_camera * camera.unproject(u, v, depth_m));
    }
  }
}

/// What of the image is at the height of the scan.
void SensorAgreement::find_points() {
  const Transform T_laser_world = T_world_laser_.inverse();
  camera_m_ = (T_laser_world * camera_world_m_).head<2>();
  points_m_.clear();
  for (const Eigen::Vector3d& p_world : image_world_m_) {
    const Eigen::Vector3d p = T_laser_world * p_world;
    if (std::abs(p.z()) > kBesidePlane_m) continue;
    if ((p.head<2>() - camera_m_).norm() > kCameraRange_m) continue;
    points_m_.emplace_back(p.head<2>());
  }
}

std::optional<double> SensorAgreement::agreement(double turn_rad) {
  const Eigen::Rotation2Dd turn(turn_rad);
  seen_m_.assign(beams_m_.size(), 0.0);
  for (const Eigen::Vector2d& point : points_m_) {
    const Eigen::Vector2d p = camera_m_ + turn * (point - camera_m_);
    const double from_first_rad = std::atan2(p.y(), p.x()) - first_rad_;
    const double turns = std::floor(from_first_rad / (2.0 * std::numbers::pi));
    const double beam = std::round((from_first_rad - 2.0 * std::numbers::pi * turns) / step_rad_);
    const double length_m = p.norm();
    if (!(beam >= 0.0) || beam >= static_cast<double>(beams_m_.size()) ||
        length_m < kNearestBeam_m) {
      continue;
    }
    double& seen_m = seen_m_[static_cast<std::size_t>(beam)];
    if (seen_m == 0.0 || length_m < seen_m) seen_m = length_m;
  }
  std::size_t told = 0, agree = 0;
  for (std::size_t beam = 0; beam < beams_m_.size(); ++beam) {
    const auto length_m = static_cast<double>(beams_m_[beam]);
    if (seen_m_[beam] == 0.0 || length_m == 0.0) continue;
    ++told;
    if (std::abs(seen_m_[beam] - length_m) < kAgree_m + kAgree * length_m) ++agree;
  }
  if (told < kFewestCompared) return std::nullopt;
  return static_cast<double>(agree) / static_cast<double>(told);
}

}  // namespace sidestep
