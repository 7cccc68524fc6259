#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/runtime/paced_frames.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/truth_check.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep {

/// A frame as it went into the map, and when its field was there.
struct MappedFrame {
  double stamp_s = 0.0;
  double received_s = 0.0;  ///< From the source.
  double published_s = 0.0;
  double integrate_ms = 0.0;
  double field_ms = 0.0;
};

/// What was mapped in some time.
struct MappingRecord {
  std::vector<MappedFrame> frames;
  std::vector<CameraView> views;
  std::int64_t dropped = 0;  ///< Frames of the source that were not mapped.
};

/// What the robot began to follow.
struct FollowedPath {
  double start_s = 0.0;
  Trajectory trajectory;
};

/// An event, and what is known of it beyond what the replanner says.
struct EpisodeEvent {
  ReplannerEvent event;
  std::optional<double> map_age_ms;  ///< Of plans and replans, as they began.
  std::optional<double> stamp_to_trajectory_ms;
  std::optional<double> frame_to_trajectory_ms;  ///< From when the source had handed it over.
};

/// A collision, and its cause: "unseen", "walked into while stopped", "fault" or "unknown".
struct EpisodeContact {
  TrueContact contact;
  std::string cause;
};

/// How the map followed what moves, where that was measured.
struct MapFollowing {
  std::vector<double> appear_frames;  ///< Of each entry into view, until it was in the map.
  std::vector<double> clear_frames;   ///< Of each voxel that was left: seen through until free.
  std::int64_t ghost_vox = 0;         ///< Left behind and still occupied at the end.
};

/// Result of one episode.
struct EpisodeRecord {
  std::int64_t episode = 0;
  bool reached = false;
  bool interrupted = false;
  std::string called_off;   ///< Why it was cancelled; empty unless it was.
  double begin_s = 0.0;     ///< On the run's clock, as all times.
  double duration_s = 0.0;  ///< Until the goal was reached, or the end.
  std::string reason;       ///< Why it did not succeed; empty if it did.
  std::int64_t steps = 0;
  std::int64_t checks = 0;
  std::int64_t frames = 0;
  std::int64_t frames_dropped = 0;
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
  std::shared_ptr<const Scene> scene;
  std::vector<EpisodeEvent> events;
  std::vector<Replanner::GuessCount> guesses;
  std::vector<MappedFrame> mapping;
  std::vector<CameraView> views;
  std::vector<FollowedPath> followed;
  std::vector<TruePose> poses;
  TrueMotion truth;
  std::optional<MapFollowing> following;
  std::vector<EpisodeContact> contacts;

  [[nodiscard]] bool success() const noexcept { return reason.empty(); }
};

}  // namespace sidestep
