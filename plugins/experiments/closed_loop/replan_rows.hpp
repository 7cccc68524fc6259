#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/measures/track_truth.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/runtime/replanner.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/truth_check.hpp>

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
  std::vector<MappedFrame> mapping;
  std::vector<CameraView> views;
  std::int64_t dropped = 0;  ///< Frames of the source that were not mapped.
};

/// What the robot began to follow.
struct FollowedPath {
  double start_s = 0.0;
  Trajectory trajectory;
  std::shared_ptr<const DistanceField> field = nullptr;  ///< Of then; null where nobody wants it.
};

/// An event, and what is known of it beyond what the replanner says.
struct EpisodeEvent : ReplannerEvent {
  std::optional<double> map_age_ms = {};  ///< Of plans and replans, as they began.
  std::optional<double> stamp_to_trajectory_ms = {};
  std::optional<double> frame_to_trajectory_ms = {};  ///< From when the source had handed it over.
};

/// A collision, and its cause: "unseen", "walked into while stopped", "its own link", "fault" or
/// "unknown".
struct EpisodeContact : TrueContact {
  std::string cause;
};

/// How the map and its tracks followed what moves, where that was measured.
struct MapFollowing {
  std::vector<double> appear_frames;      ///< Of each entry into view, until it was in the map.
  std::vector<double> clear_frames;       ///< Of each voxel that was left: seen through until free.
  std::optional<std::int64_t> ghost_vox;  ///< Left behind and still occupied at the end.
  std::optional<std::int64_t> entered_vox;  ///< By the robot's spheres.
  std::optional<std::int64_t> seen_vox;     ///< Of these, those that a frame had seen before.
  std::optional<TrackRecord> tracks;        ///< Nothing where there are none.
};

/// What is said of an episode in a word, and stored as it is.
struct EpisodeFigures {
  std::int64_t episode = 0;
  bool reached = false;
  double begin_s = 0.0;     ///< On the run's clock, as all times.
  double duration_s = 0.0;  ///< Until the goal was reached, or the end.
  std::string reason;       ///< Why it did not succeed; empty if it did.
  std::int64_t steps = 0;
  std::int64_t checks = 0;
  std::int64_t frames = 0;
  std::int64_t frames_dropped = 0;
  std::optional<double> free_run_s = {};  ///< What the same took without people.
  /// How far the base of one that reached its goal truly stands from where it was to stand.
  std::optional<double> goal_error_m = {};
  /// Motions that it followed, stops included, and those of them that are proven to be clear of
  /// what the map held as they began; nothing where no certificates were asked for.
  std::optional<std::int64_t> motions = {};
  std::optional<std::int64_t> proven_motions = {};
  /// Promises of docs/closed_loop.md that it broke; nothing where nobody looked.
  std::optional<std::int64_t> broken_policies = {};
};

/// Result of one episode.
struct EpisodeRecord : EpisodeFigures, MappingRecord {
  bool interrupted = false;
  std::string called_off;  ///< Why it was cancelled; empty unless it was.
  Eigen::VectorXd q_goal;
  std::shared_ptr<const Scene> scene;
  std::vector<EpisodeEvent> events;
  std::vector<Replanner::GuessCount> guesses;
  std::vector<FollowedPath> followed;  ///< Without stops,
  std::vector<FollowedPath> moved;     ///< and with them, for certificates.
  std::vector<TruePose> poses;
  TrueMotion truth;
  std::optional<MapFollowing> following;
  std::vector<EpisodeContact> contacts;

  [[nodiscard]] bool success() const noexcept { return reason.empty(); }
};

/// The cause of a contact: "its own link" for one of the robot with itself, "walked into while
/// stopped" where no joint moved faster than `rest_speed`; "unseen" where not every frame of the
/// half second before shows the object, the robot's own body aside; "unknown" where no depth image
/// was kept; else "fault".
[[nodiscard]] std::string cause_of(const TrueContact& contact, const EpisodeRecord& episode,
                                   double rest_speed);

/// What a shape covers of the ground, seen from above: corners of its convex hull,
/// counter-clockwise; empty for a half-space.
[[nodiscard]] std::vector<Eigen::Vector2d> outline_from_above(const Shape& shape,
                                                              const Transform& T_world_shape);

/// One episode as a results store holds it: what summaries are made from.
struct EpisodeRow : EpisodeFigures, MapFollowing {
  bool success = false;
  std::optional<double> path_length;   ///< Of the way it went, in the space of joints, rad and m.
  std::optional<double> head_way_rad;  ///< That its pan and tilt turned together.
  std::optional<double> min_true_clearance_m;
  /// That it is of, and to which object, and when; empty where nothing came near.
  std::optional<std::string> nearest_link;
  std::optional<std::string> nearest_object;
  std::optional<double> nearest_s;
  std::int64_t collisions = 0;
  std::int64_t own_collisions = 0;  ///< Of these, the robot's.
  std::int64_t replans = 0;
  std::int64_t stops = 0;
  std::int64_t slowdowns = 0;
  double splice_velocity_jump_max = 0.0;
  std::vector<double> solve_ms;   ///< Of plans and replans.
  std::vector<double> search_ms;  ///< Of these, and of searches that failed.
  std::vector<double> unknown_share;
  std::vector<double> map_age_ms;
  std::vector<double> stamp_to_trajectory_ms;
  std::vector<double> frame_to_trajectory_ms;
};

/// A part of an episode, as it is stored.
template <class Part>
struct OfEpisode : Part {
  std::int64_t episode = 0;
};
/// Its texts are stored, and not read back: an event has far more numbers.
using EventRow = OfEpisode<EpisodeEvent>;
using ContactRow = OfEpisode<EpisodeContact>;

/// What a run of a closed loop is, beyond its episodes. Of the whole, where it is a shard.
struct ReplanHead : DividedRun {
  std::string about = "{}";  ///< With what clock, robot, limits and optimiser it is run, as JSON.
  /// The command that runs it again, up to which of its episodes; empty where none can be run by
  /// itself.
  std::string again;
  std::int64_t first_episode = 0;
  std::int64_t episodes = 0;  ///< That are planned; 0: as many as there are.

  [[nodiscard]] bool is_its(std::int64_t episode) const noexcept {
    return (episode - first_episode) % shard.count == shard.index;
  }
};

/// What a results store holds of a replan experiment.
struct ReplanRows {
  ReplanHead head;
  std::vector<EpisodeRow> episodes;  ///< In ascending order.
  std::vector<ContactRow> contacts;
  std::vector<Replanner::GuessCount> guesses;  ///< Of all episodes together, in order of trial.
};

inline constexpr const char* kRunSeries = "run";
/// Item 0 of that.
void record_replan_head(const ReplanHead& head, Recorder& recorder);

/// Series "episode" (one item an episode), "event", "contact" and "guess"; and where `pictures` >
/// 0, "picture/EPISODE", so many spread evenly over its time: the robot, the obstacles, the way so
/// far and what is being followed, from above.
void record_episode(const EpisodeRecord& episode, const RobotModel& robot, int pictures,
                    Recorder& recorder);

/// The events of an episode, with their items.
[[nodiscard]] Result<StoredRow<EventRow>::Rows> read_events(ResultsReader& reader,
                                                            std::int64_t episode);

/// Reads back what was recorded. Fails with kIo where the store is that of no replan experiment.
[[nodiscard]] Result<ReplanRows> read_replan_rows(const std::filesystem::path& file);

}  // namespace sidestep
