#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

class MotionBounds;

/// A prediction on the clock of a trajectory.
struct PredictionOnClock {
  std::shared_ptr<const Prediction> prediction;  ///< Not null.
  double from_s = 0.0;  ///< The prediction's time at the trajectory's time 0.
};

/// Where a motion meets what is predicted to move.
struct PredictedConflict {
  double time_s = 0.0;       ///< On the trajectory's clock.
  double clearance_m = 0.0;  ///< Of the sphere and the set that are nearest then.
  int link = 0;              ///< Of that sphere.
  std::int64_t track = 0;    ///< Of that set.
};

/// Shows motions clear of predicted sets over continuous time, by conservative advancement: from an
/// instant at which all spheres are clear by c, no time passes unlooked at in which spheres and
/// sets together could come nearer by c (Mirtich 1996, with bounds on the links' speeds as in
/// motion_bounds.hpp). Immutable; [any].
class SIDESTEP_EXPORT PredictionCheck {
 public:
  /// `margin_m`: that spheres keep from sets.
  PredictionCheck(std::shared_ptr<const RobotModel> robot, double margin_m);

  /// The first instant from `from_s` on at which a sphere is within the margin of a set; nothing
  /// where there is none until the trajectory or the prediction ends. A robot that begins within
  /// the margin has to come no nearer than it begins. `trajectory` is valid and of the robot.
  /// Allocates.
  [[nodiscard]] std::optional<PredictedConflict> first_conflict(
      const Trajectory& trajectory, double from_s, const PredictionOnClock& predicted) const;

  [[nodiscard]] double margin_m() const noexcept { return margin_m_; }
  [[nodiscard]] const RobotModel& robot() const noexcept { return *robot_; }

 private:
  std::shared_ptr<const RobotModel> robot_;
  double margin_m_;
  std::vector<double> levers_;  ///< By joint: the largest of any sphere, m per m or m per rad.
};

/// The fastest motion along the path of a trajectory, from `from_s` on no faster than the
/// trajectory at each place, that is clear of what is predicted: it slows down and waits where it
/// has to (path-time decomposition, Kant and Zucker 1986). The s-t plane is cut into steps of time
/// in which the speed changes by an eighth of the trajectory's, or stays; among those motions it is
/// the fastest, and check.first_conflict() finds none on it. Before `from_s` it is the trajectory
/// itself, and velocities are continuous. It keeps `limits` as the trajectory does, to within a few
/// per cent of the accelerations.
///
/// Nothing where no such motion is clear. A trajectory that is clear itself comes back as it is.
/// [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT std::optional<Trajectory> retime_among(
    const Trajectory& trajectory, double from_s, const MotionLimits& limits,
    const PredictionOnClock& predicted, const PredictionCheck& check);

/// Whether a motion that ends at rest keeps velocities and, to within a few per cent,
/// accelerations. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT bool keeps_limits(const Trajectory& motion,
                                                const MotionLimits& limits);

}  // namespace sidestep
