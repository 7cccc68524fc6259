#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/mapping/fault_verdict.hpp>
#include <sidestep/mapping/self_filter.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Watches the frames of one sensor for faults that no frame shows alone: one that is frozen, one
/// that is blind, a camera whose mount or lens is not what it is said to be, and a laser before
/// which something hangs on its own robot. Clouds other than planar scans pass.
class SIDESTEP_EXPORT SensorCheck {
 public:
  /// Of the plane that a camera sees as the floor. A camera that is mounted with care is off by
  /// less than half a degree.
  static constexpr double kMaxTilt_rad = 0.0349;  // 2 degrees

  /// `floor_z_m`: height in the world of the floor that the robot stands on; nothing: it is not
  /// known, and neither blindness nor tilt of a camera can be told. `robot`: whose known shapes a
  /// laser may see; null: none.
  explicit SensorCheck(std::optional<double> floor_z_m,
                       std::shared_ptr<const RobotModel> robot = nullptr)
      : floor_z_m_(floor_z_m), has_robot_(robot != nullptr), self_(std::move(robot), kSelf_m) {}

  /// Fails with kBadFrame, naming the fault, from when it is certain until it is gone, see
  /// FaultVerdict. Passes by frames that check_frame() does not pass. [mapping]; allocates at
  /// first.
  [[nodiscard]] Result<void> check(const Frame& frame);

 private:
  static constexpr double kSelf_m = 0.05;  ///< What is so near to a known shape may be it.

  /// One of the pixels, or of the beams, that are looked at.
  struct Sample {
    int u, v;
    int tile;             ///< Of nine parts of the image or the scan.
    float depth_m;        ///< Of a beam, its length; 0: no return.
    Eigen::Vector3d p_m;  ///< From the point of the floor below the sensor, z up.
  };
  /// The plane z = slope . (x, y) + offset_m.
  struct Plane {
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    double offset_m = 0.0;
    [[nodiscard]] bool holds(const Eigen::Vector3d& p) const;
  };
  struct Scan {
    Transform T_world_laser;
    std::vector<double> beams_m;  ///< Their lengths.
  };
  void take_samples(const Frame& frame, const DepthImage& image);
  void take_samples(const Frame& frame, const PointCloud& scan);
  [[nodiscard]] FaultSign is_frozen(const Frame& frame);
  [[nodiscard]] bool is_noise() const;
  [[nodiscard]] FaultSign is_blind(const Frame& frame, const DepthImage& image);
  [[nodiscard]] FaultSign sees_robot(const Frame& frame);
  [[nodiscard]] std::optional<double> hangs_in_both(const Scan& then, const Scan& now,
                                                    const Frame& frame);
  [[nodiscard]] static std::optional<double> nearness_of(const std::vector<double>& scan_m,
                                                         std::size_t first, std::size_t end);
  [[nodiscard]] FaultSign is_tilted(double camera_height_m);
  [[nodiscard]] std::optional<Plane> plane_through(std::size_t i, std::size_t j,
                                                   std::size_t k) const;
  [[nodiscard]] std::size_t count(const Plane& plane) const;
  [[nodiscard]] std::optional<Plane> refined(const Plane& plane) const;

  std::optional<double> floor_z_m_;
  bool has_robot_;
  std::vector<Sample> samples_, last_;
  std::vector<Eigen::Vector3d> candidates_m_;  ///< Of the floor, as far as a tilted one may be.
  Transform T_world_last_ = Transform::Identity();
  Transform T_world_first_ = Transform::Identity();  ///< Of the first of the equal images.
  std::optional<double> returned_;                   ///< Share of the last image.
  bool has_failed_ = false;                          ///< It is blind, and was not before.
  int noisy_pairs_ = 0;
  double tilt_rad_ = 0.0;  ///< Seen last before it was certain.
  SelfFilter self_;
  double hanging_m_ = 0.0;  ///< How near that is which hangs before the laser.
  std::deque<Scan> scans_;  ///< Of the last bit of its way, the oldest first.
  FaultVerdict frozen_, blind_, tilted_, obstructed_;
};

}  // namespace sidestep
