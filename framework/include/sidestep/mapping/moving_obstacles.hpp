#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// A ball around a place that something has moved into. World frame.
struct MovingBall {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  /// When it was there, if it has been out of view since; nothing: at MovingObstacles::stamp.
  std::optional<Stamp> seen = std::nullopt;
};

/// Where things move, or moved when they were last in view, as one immutable snapshot of a map.
struct MovingObstacles {
  std::vector<MovingBall> balls;
  Stamp stamp;  ///< Of the newest frame in it.
};

struct MotionDetectorSettings {
  double memory_s = 1.0;  ///< The map of now is held against the one of so long ago.
  double cell_m = 0.25;   ///< Voxels in one cell make one ball.
  int least_vox = 3;      ///< A cell with fewer voxels is noise.
};

/// Detects moving voxels: occupied now, seen free before, more than one voxel away from what was
/// occupied a while ago, and not hidden behind it, with free space behind them as deep as depth is
/// noisy. Surfaces that come into view or into range do not count, since they, or what is behind
/// them, were unknown or hidden; neither does flicker at the edges of what stands, or in a layer
/// seen at a grazing angle below 20 degrees. An object is detected after it has moved by two
/// voxels, and forgotten after it has stood for one and a half times the memory. [mapping]
class SIDESTEP_EXPORT MotionDetector {
 public:
  explicit MotionDetector(MotionDetectorSettings settings = {}) : settings_(settings) {}

  /// look(), and then remember().
  [[nodiscard]] std::shared_ptr<const MovingObstacles> update(const OccupancyView& map,
                                                              const Eigen::Vector3d& eye_m,
                                                              Stamp stamp);

  /// What moves in the map after a frame with this stamp. Where the grid has moved or the stamps
  /// went back, it starts over. Allocates.
  [[nodiscard]] std::shared_ptr<const MovingObstacles> look(const OccupancyView& map, Stamp stamp);
  /// Stores the map for later comparison, at most twice per memory. `eye_m` is from where its
  /// newest frame was taken; cameras may take turns. Call it after look(), with the same map; no
  /// field waits for it.
  void remember(const OccupancyView& map, const Eigen::Vector3d& eye_m, Stamp stamp);

 private:
  /// A map as it was.
  struct Past {
    Stamp stamp;
    std::vector<Eigen::Vector3d> eyes_m;  ///< From where it was seen; the newest first.
    GridSpec grid;
    std::vector<std::uint64_t> known;
    std::vector<std::uint64_t> occupied;
    int words_per_row = 0;
    std::vector<char> blocks;                  ///< Whether anything in them was occupied.
    std::vector<std::uint64_t> near_occupied;  ///< Occupied, or one voxel beside it.
    /// What could_be_seen() has said of voxels that were asked for.
    std::vector<std::uint64_t> in_sight, hidden;
  };
  static void note(const OccupancyView& map, Past& past);
  [[nodiscard]] static bool could_be_seen(const Eigen::Vector3d& p, const Past& then);
  [[nodiscard]] static bool could_be_seen_from(const Eigen::Vector3d& eye_m,
                                               const Eigen::Vector3d& p, const Past& then);

  MotionDetectorSettings settings_;
  std::vector<Eigen::Vector3d> eyes_m_;  ///< Of the frames since the newest of these.
  std::deque<Past> past_;                ///< Oldest first.
  Past spare_;                           ///< A forgotten one, for its memory.
};

/// Keeps in mind what moved when it was last in view: a camera that looks elsewhere does not see
/// where it went. [mapping]
class SIDESTEP_EXPORT MotionMemory {
 public:
  /// Adds to what moves after a frame what moved up to three seconds before and has not been in an
  /// image since; point clouds show nothing to be gone. `moving` is the detector's, frame by frame.
  /// Allocates.
  void add_unseen(const Frame& frame, MovingObstacles& moving);

 private:
  std::vector<MovingBall> balls_;  ///< Of the last frame; `seen` is told of each.
};

}  // namespace sidestep
