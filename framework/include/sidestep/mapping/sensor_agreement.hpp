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

  /// A laser's scan, other than one of a laser that is not level, which is passed by. [mapping]
  void note_scan(const Frame& frame);

  /// Fails with kBadFrame from when it is certain that images do not agree with the last scan until
  /// they do, see FaultVerdict. Passes by what is no image, what comes later than 0.15 s after that
  /// scan, and what check_frame() does not pass. [mapping]; allocates at first.
  [[nodiscard]] Result<void> check(const Frame& frame);

 private:
  [[nodiscard]] FaultSign sign_in(const Frame& frame);
  void take_points(const Frame& frame, const DepthImage& image);
  /// Of the beams in which the camera sees something, turned about where it is, the share that ends
  /// there; nothing where there are too few.
  [[nodiscard]] std::optional<double> agreement(double turn_rad);

  Stamp stamp_;  ///< Of the scan.
  Transform T_world_laser_ = Transform::Identity();
  std::vector<float> beams_m_;  ///< Its lengths; 0: no return. Empty before the first one.
  double first_rad_ = 0.0, step_rad_ = 0.0;
  Eigen::Vector2d camera_m_ = Eigen::Vector2d::Zero();  ///< In the laser's frame, as what follows.
  std::vector<Eigen::Vector2d> points_m_;
  std::vector<double> seen_m_;  ///< Of each beam, how far the camera's nearest point in it is.
  double turn_rad_ = 0.0;       ///< Seen last before it was certain.
  FaultVerdict verdict_;
};

}  // namespace sidestep
