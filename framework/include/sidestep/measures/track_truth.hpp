#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/mapping/tracks.hpp>

namespace sidestep {

/// How tracks compare with the objects that truly move.
struct TrackRecord {
  /// Frames, object by object, in which one was in view and had moved there for a second already,
  /// and those of them in which a track was at most half a metre away from it.
  std::int64_t due_frames = 0;
  std::int64_t found_frames = 0;
  /// From when an object was in view and moving until it was tracked; nothing for those that left
  /// the view before.
  std::vector<double> delay_s;
  std::int64_t switches = 0;  ///< Changes of an object's id while it was in view.
  // Of every frame in which an object in view was found.
  std::vector<double> position_error_m;
  std::vector<double> velocity_error_mps;
  std::int64_t false_tracks = 0;  ///< Ids that never were within half a metre of what moves.
};

/// Holds tracks, map by map, against a scene's objects that move and are as large as people: no
/// wider than 1 m. [mapping]
class TrackTruth {
 public:
  explicit TrackTruth(const Scene& scene);

  /// Once for each map. `in_view`: the scene's objects that its frame shows, as
  /// MapTruth::in_view() says.
  void observe(const Tracks& tracks, std::span<const std::size_t> in_view);

  [[nodiscard]] TrackRecord finish() const;

 private:
  struct Person {
    std::size_t object = 0;
    double in_view_s = -1.0;      ///< When it was last seen.
    double moved_since_s = -1.0;  ///< Since when it has been in view and had moved; < 0: not.
    bool is_found = false;        ///< Since then.
    std::int64_t id = 0;          ///< That of its track, while it is in view; 0: none so far.
  };

  void follow(Person& person, double now_s, const Eigen::Vector2d& velocity_mps, bool in_view,
              const Track* track);

  const Scene& scene_;
  std::vector<Person> people_;
  std::set<std::int64_t> ids_, true_ids_;
  TrackRecord record_;
};

}  // namespace sidestep
