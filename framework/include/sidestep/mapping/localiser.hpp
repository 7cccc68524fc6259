#pragma once

#include <string>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/geometry/transform.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// Where the odometry's frame lies in the map's.
struct Localisation {
  /// From the frame that poses of frames and joint positions are measured in to the map's. Of a
  /// robot whose base moves in the plane: a rotation about z, and no z.
  Transform T_map_odom = Transform::Identity();
  /// Standard deviations of where the sensor, or the base, is in the map, along the direction in
  /// which least is known.
  double sigma_m = 0.0;
  double sigma_rad = 0.0;
  /// Why that is not good enough to move by; empty where it is.
  std::string lost;
};

/// Finds out where frames were taken in the map that they are to go into: what odometry has drifted
/// by. One object has one run, and the frames of one sensor.
class SIDESTEP_EXPORT Localiser {
 public:
  virtual ~Localiser() = default;
  /// By one more frame, whose pose and joint positions are those of the odometry. `field`: of the
  /// newest map, before that frame; null for the first, which says what the map's frame is. What
  /// the scene does not tell, odometry does, and `sigma_m` and `sigma_rad` grow. Fails with
  /// kBadFrame where that one frame is to be left out, with any other code for good: it ends the
  /// mapping. [mapping]; may allocate.
  [[nodiscard]] virtual Result<Localisation> localise(const Frame& frame,
                                                      const DistanceField* field) = 0;
};

}  // namespace sidestep
