#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/mapping/moving_obstacles.hpp>
#include <sidestep/mapping/self_filter.hpp>
#include <sidestep/mapping/track_mask.hpp>
#include <sidestep/mapping/tracks.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

struct TrackerSettings {
  double acceleration_mps2 = 1.0;  ///< Standard deviation of how things change their velocity.
  double start_speed_mps = 1.0;    ///< Standard deviation of a new thing's velocity, per axis.
  double measurement_m = 0.05;     ///< Standard deviation of a measured position: about a voxel.
  double survival_s = 1.5;         ///< How long a moving thing is tracked out of sight.
  double stay_s = 30.0;            ///< What has stood for so long is the map's again.
  int confirming_hits = 3;         ///< Frames that must show a thing move before it is tracked.
  double settle_s = 1.5;           ///< As TrackMask has it.
  double floor_m = 0.1;            ///< Lower points are the floor's.
  double robot_margin_m = 0.05;    ///< Points so near to the robot's spheres are its own.
};

/// Tracks what moves, one Kalman filter of constant velocity a thing (white acceleration;
/// Bar-Shalom, Li and Kirubarajan 2001, ch. 6.3). A thing is first found by a MotionDetector, or
/// by points in voxels that have been seen free. Then each frame is asked for the surface points
/// near where it should be now, less those on settled voxels; a point belongs to the nearest thing.
/// Its position is that of a vertical cylinder of its radius through them: voxels lag behind by up
/// to 0.4 s, points do not. The radius converges to that of what moves, at most 0.45 m; a track's
/// is a voxel and a half greater, so that it covers all that is masked for it. It reaches from the
/// floor to the top of what moves, less what a frame has seen through.
///
/// A thing that moves keeps its id out of sight for survival_s, or for twice as long as it has been
/// seen if that is less. One that stands keeps it for
/// stay_s, seen or not, while the map has voxels at its place. [mapping]
class SIDESTEP_EXPORT Tracker {
 public:
  /// Points on the robot, which may be null, are nobody's.
  explicit Tracker(TrackerSettings settings = {}, std::shared_ptr<const RobotModel> robot = nullptr)
      : settings_(settings),
        self_(std::move(robot), settings.robot_margin_m),
        mask_(settings.settle_s) {}

  /// What is tracked in the map after a frame, given where something moves in it. The frame is
  /// valid, as a mapper that has integrated it says. Allocates, but no memory of the map's size
  /// while its grid stays.
  [[nodiscard]] std::shared_ptr<const Tracks> update(const OccupancyView& map,
                                                     const MovingObstacles& moving,
                                                     const Frame& frame);

  /// The occupied voxels that belong to what is tracked, in that map; valid until the next update.
  [[nodiscard]] std::span<const MaskedWord> mask() const noexcept { return mask_.mask(); }

 private:
  /// What is tracked, or may come to be.
  struct Thing {
    Track track;
    Eigen::Vector2d first_m = Eigen::Vector2d::Zero();
    double farthest_m = 0.0;  ///< From where it was first.
    Stamp moved;              ///< When the detector last saw it move.
    int hits = 0;
    int voxels = 0;
    bool is_confirmed = false;
    bool is_held = false;  ///< Stands, out of sight.
  };
  struct Sighting {
    Eigen::Vector2d position_m;
    Eigen::Matrix2d covariance;
    double half_width_m = 0.0;
  };

  void predict(Thing& thing, double dt_s) const;
  [[nodiscard]] bool may_be_settled(const Eigen::Vector3d& p, const Eigen::Vector3d& eye_m) const;
  [[nodiscard]] std::optional<Sighting> look_for(const Thing& thing, const Frame& frame);
  /// A cylinder through points_, about where the thing is.
  [[nodiscard]] std::optional<Sighting> fit(const Thing& thing, const Eigen::Vector2d& eye_m,
                                            double spacing_m);
  void correct(Thing& thing, const Sighting& sighting, Stamp stamp) const;
  void note_motion(const MovingObstacles& moving, Stamp stamp);
  void find_strays(const OccupancyView& map, const Frame& frame);
  void find_new(const std::vector<MovingBall>& balls, const Frame& frame);
  void remove_doubles(Stamp stamp);
  void end_lost(Stamp stamp);
  [[nodiscard]] std::shared_ptr<const Tracks> claim(const Frame& frame);
  [[nodiscard]] bool is_lost(const Thing& thing, Stamp stamp) const;

  TrackerSettings settings_;
  SelfFilter self_;
  TrackMask mask_;
  std::vector<Thing> things_;
  std::vector<MovingBall> strays_;  ///< Of the newest frame.
  Stamp stamp_;
  std::int64_t next_id_ = 1;
  // Scratch: others beside a thing, points near it, those of them that fit it, and their places
  // along and across the line of sight.
  std::vector<Track> rivals_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<Eigen::Vector2d> chosen_;
  std::vector<double> along_m_, across_m_;
};

}  // namespace sidestep
