#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include <sidestep/geometry/ray_caster.hpp>
#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// `experiment.truth`: how maps are held against the true scene.
struct TruthSettings {
  bool measure = true;
  int pixel_stride = 8;
  double min_z_m = 0.1;
  double max_range_m = 4.5;

  static Parameters<TruthSettings> parameters();
};

/// How a map compares with the true scene behind its frames.
struct TruthRecord {
  // Surfaces that stand still, at the end of the run.
  std::int64_t surface_vox = 0;        ///< Voxels in which the camera saw a surface.
  std::int64_t surface_found_vox = 0;  ///< Of those: an occupied voxel is no more than one away.
  std::int64_t occupied_vox = 0;
  std::int64_t false_vox = 0;  ///< Occupied, and no surface is within a voxel's diagonal.
  // Objects that move.
  std::vector<double> appear_frames;  ///< Of each entry into view: 1 is the very frame.
  std::int64_t never_appeared = 0;    ///< Objects that left the view before they appeared.
  std::vector<double> gone_frames;    ///< Of each voxel that was left: frames of seeing through it.
  std::int64_t ghost_vox = 0;         ///< Left behind and still occupied at the end.
  std::int64_t ghost_seen_vox = 0;    ///< Of those: seen through at least once since.

  [[nodiscard]] std::optional<double> collision_recall() const {
    if (surface_vox == 0) return std::nullopt;
    return static_cast<double>(surface_found_vox) / static_cast<double>(surface_vox);
  }
};

/// Follows one map, frame by frame, against the scene. What the camera sees is told by exact rays
/// through every n-th pixel; pixels without a measurement say nothing. A voxel is at a surface if
/// its centre is within one voxel's diagonal of it. [mapping]
class MapTruth {
 public:
  MapTruth(const Scene& scene, const GridSpec& grid, const TruthSettings& settings);

  /// Once for each frame, after the map has integrated it.
  void observe(const Frame& frame, const OccupancyView& map);

  /// The scene's objects that move and that the newest frame shows in the map's volume, by number.
  [[nodiscard]] std::vector<std::size_t> in_view() const;

  /// After the last frame.
  [[nodiscard]] TruthRecord finish(const OccupancyView& map) const;

 private:
  /// An object that moves, and whether it is in view.
  struct Mover {
    std::size_t object = 0;
    Eigen::Vector3d half_extent_m;  ///< Of a box around it in its own frame.
    bool in_view = false;
    bool has_appeared = false;
    int frames_in_view = 0;
  };
  /// The pixels that are looked at: where the rays go and what they hit.
  struct Sight {
    std::vector<Eigen::Vector3d> origins, directions;
    std::vector<RayHit> hits;
  };

  void look(const Frame& frame);
  void see_surfaces();
  void follow_movers(const OccupancyView& map);
  void sweep_movers(double time_s);
  void follow_leavings(const Frame& frame, const OccupancyView& map);
  [[nodiscard]] bool seen_through(const Frame& frame, const Eigen::Vector3d& centre_m) const;
  [[nodiscard]] bool has_occupied_near(const OccupancyView& map,
                                       const Eigen::Vector3i& voxel) const;

  const Scene& scene_;
  GridSpec grid_;
  TruthSettings settings_;
  double near_m_;  ///< A voxel's diagonal.
  RayCaster caster_;
  Sight sight_;
  std::vector<Mover> movers_;
  double time_s_ = 0.0;
  std::vector<bool> surface_;  ///< Seen surfaces of what stands still, a bit a voxel.
  std::vector<bool> swept_;    ///< Where something that moves has been.
  std::vector<std::size_t> swept_list_;
  /// Voxels that were occupied while something was there, and are since: by how many frames they
  /// were seen through once it had left.
  std::unordered_map<std::size_t, int> leaving_;
  TruthRecord record_;
};

}  // namespace sidestep
