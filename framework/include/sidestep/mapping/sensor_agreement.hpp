#pragma once

#include <optional>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/mapping/fault_verdict.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Holds what a camera sees at the height of a planar laser against that laser's last scan: whether
/// one of the two is turned about the vertical, or a lens's middle is off to a side. Which of them
/// it is, nobody can tell. Says nothing where they do not see much of the same.
class SIDESTEP_EXPORT SensorAgreement {
 public:
  /// A sensor that is mounted with care is off by less than half a degree.
  static constexpr double kMaxTurn_rad = 0.0349;  // 2 degrees

  /// Fails with kBadFrame, for images alone, from when it is certain that they do not agree with
  /// the scans until they do, see FaultVerdict. Compares what was taken within 25 ms, whichever
  /// comes first; passes by a laser that is not level, other clouds, and what check_frame() does
  /// not pass. [mapping]; allocates at first.
  [[nodiscard]] Result<void> check(const Frame& frame);

 private:
  void take_image(const Frame& frame, const DepthImage& image);
  void take_scan(const Frame& frame, const PointCloud& scan);
  /// Of the last image and the last scan.
  [[nodiscard]] FaultSign sign();
  void find_points();
  /// Of the beams in which the camera sees something, turned about where it is, the share that ends
  /// there; nothing where there are too few.
  [[nodiscard]] std::optional<double> agreement(double turn_rad);

  std::optional<Stamp> image_stamp_;  ///< Nothing before the first one.
  Eigen::Vector3d camera_world_m_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> image_world_m_;
  Stamp scan_stamp_;
  Transform T_world_laser_ = Transform::Identity();
  std::vector<float> beams_m_;  ///< Lengths of the scan's; 0: no return. Empty where there is none.
  double first_rad_ = 0.0, step_rad_ = 0.0;
  Eigen::Vector2d camera_m_ = Eigen::Vector2d::Zero();  ///< In the laser's frame, as what follows.
  std::vector<Eigen::Vector2d> points_m_;
  std::vector<double> seen_m_;  ///< Of each beam, how far the camera's nearest point in it is.
  double turn_rad_ = 0.0;       ///< Seen last before it was certain.
  FaultVerdict verdict_;
};

}  // namespace sidestep
