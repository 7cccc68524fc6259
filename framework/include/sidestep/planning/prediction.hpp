#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/field/distance_field.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// Where one tracked thing may be: anywhere in a vertical cylinder whose centre and radius change
/// linearly from knot to knot. Before the first knot and after the last one there is none. World
/// frame.
struct PredictedSet {
  struct Knot {
    double time_s = 0.0;  ///< After Prediction::stamp().
    Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
    double radius_m = 0.0;
  };
  std::int64_t track = 0;   ///< Track::id.
  double likelihood = 1.0;  ///< (0, 1]; sets of one track are alternatives.
  double bottom_m = 0.0;
  double top_m = 0.0;
  std::vector<Knot> knots;  ///< At least one; times strictly ascending.
};

/// Where all that is tracked may be, from a stamp on. Immutable. [any]
class SIDESTEP_EXPORT Prediction {
 public:
  /// Nothing anywhere.
  Prediction() = default;
  /// Fails with kInvalidArgument, naming the set's track, where a number is not finite, a radius
  /// or height is negative, a likelihood is outside (0, 1], or knots are missing or out of order.
  [[nodiscard]] static Result<Prediction> create(Stamp stamp, std::vector<PredictedSet> sets);

  [[nodiscard]] Stamp stamp() const noexcept { return stamp_; }
  [[nodiscard]] const std::vector<PredictedSet>& sets() const noexcept { return sets_; }
  /// Time of the last knot of all; 0 where there is none.
  [[nodiscard]] double end_s() const noexcept { return end_s_; }
  /// By which distances fall at most in a second, while no set appears: how fast surfaces move.
  [[nodiscard]] double speed_mps() const noexcept { return speed_mps_; }

  /// Signed distance of points to the nearest set at one time after stamp(), negative inside;
  /// infinity where there is none. gradients: in space; as many as points, or empty where none are
  /// wanted. Does not allocate.
  void query(double time_s, std::span<const Eigen::Vector3d> points_m,
             std::span<double> distances_m, std::span<Eigen::Vector3d> gradients) const noexcept;
  /// Track of the set that is nearest to a point at one time; 0 where there is none.
  [[nodiscard]] std::int64_t nearest_track(double time_s,
                                           const Eigen::Vector3d& p_m) const noexcept;

 private:
  Stamp stamp_;
  std::vector<PredictedSet> sets_;
  double end_s_ = 0.0;
  double speed_mps_ = 0.0;
};

/// How fast somebody may walk up (ISO 13855).
inline constexpr double kWalkingSpeed_mps = 1.6;

/// The robot as people see it: a disc on the floor. World frame.
struct RobotFootprint {
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
};

/// A disc around the spheres of a robot in a state, seen from above. [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT RobotFootprint footprint(const RobotModel& robot,
                                                       const RobotState& state);

/// What a prediction is made from. References hold during the call.
struct PredictionRequest {
  const Tracks& tracks;
  double horizon_s = 0.0;                 ///< Sets are wanted up to here, after tracks.stamp.
  const DistanceField* field = nullptr;   ///< The map without what is tracked; may be null.
  const RobotFootprint* robot = nullptr;  ///< Null where it is not known.
};

/// The largest standard deviation of a track's position in any direction, in m; NaN where the
/// covariance is not finite. [any]
[[nodiscard]] SIDESTEP_EXPORT double position_deviation_m(const Track& track) noexcept;

/// Fails with kInvalidArgument, naming the track, where a number of one is not finite, or its
/// radius or height is negative. [any]
[[nodiscard]] SIDESTEP_EXPORT Result<void> check_tracks(const Tracks& tracks);

/// Each track wherever it could be if it had walked at `speed_mps` in whatever direction since it
/// was last seen: a cylinder that stands and grows until `horizon_s`, wider than the track by
/// `sigmas` standard deviations of its position. Fails as check_tracks(). [any]; allocates.
[[nodiscard]] SIDESTEP_EXPORT Result<Prediction> worst_case_prediction(const Tracks& tracks,
                                                                       double speed_mps,
                                                                       double horizon_s,
                                                                       double sigmas = 2.0);

/// What a predictor's sets are of.
enum class PredictionSubject {
  kTracks,   ///< Each track has a set, or several, and nothing else has.
  kThings,   ///< What truly is there, tracked or not.
  kNothing,  ///< There are none: what is tracked has to stay in the map.
};

/// Says where tracked things may be. Its prediction has the stamp of the tracks; each track has a
/// set, or several whose likelihoods sum to 1 at most, and each set begins at time 0 or before and
/// lasts until the horizon. A prediction is no promise: what keeps the robot safe does not rest on
/// it (docs/closed_loop.md).
class SIDESTEP_EXPORT Predictor {
 public:
  virtual ~Predictor();
  /// Fails where it cannot tell. [planning]; allocates.
  [[nodiscard]] virtual Result<Prediction> predict(const PredictionRequest& request) = 0;
  /// Of anything but tracks, sets need not be of the tracks, nor begin or end at any time. [any]
  [[nodiscard]] virtual PredictionSubject subject() const noexcept;
};

}  // namespace sidestep
