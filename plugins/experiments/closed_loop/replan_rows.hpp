#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <sidestep/results/stored_row.hpp>
#include <sidestep/runtime/results_store.hpp>
#include "replan_types.hpp"

namespace sidestep {

/// Items of the series "event", "contact" and "guess": those of an episode begin here.
[[nodiscard]] constexpr std::int64_t first_item_of(std::int64_t episode) {
  return episode * 100'000;
}

/// One episode as a results store holds it: what summaries are made from.
struct EpisodeRow {
  std::int64_t episode = 0;
  bool success = false;
  bool reached = false;
  double begin_s = 0.0;
  double duration_s = 0.0;
  std::optional<double> path_length;  ///< Of the way it went, in the space of joints, rad and m.
  std::optional<double> min_true_clearance_m;
  /// That it is of, and to which object, and when; empty where nothing came near.
  std::optional<std::string> nearest_link;
  std::optional<std::string> nearest_object;
  std::optional<double> nearest_s;
  std::int64_t collisions = 0;
  std::int64_t steps = 0;
  std::int64_t checks = 0;
  std::int64_t frames = 0;
  std::int64_t frames_dropped = 0;
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
  std::vector<double> appear_frames;
  std::vector<double> clear_frames;
  std::optional<std::int64_t> ghost_vox;  ///< Nothing where it was not measured.
  std::string reason;
};

struct EventRow {
  std::int64_t episode = 0;
  ReplannerEvent::Kind kind = ReplannerEvent::Kind::kPlanned;
  double time_s = 0.0;
  double solve_ms = 0.0;
  int attempts = 0;
  double cost = 0.0;
  double splice_velocity_jump = 0.0;
  double takeover_s = 0.0;
  double map_stamp_s = 0.0;
  double unknown_share = 0.0;
  std::optional<double> map_age_ms;
  std::optional<double> stamp_to_trajectory_ms;
  std::optional<double> frame_to_trajectory_ms;
  std::string cause, reason, guess;  ///< Stored, not read back: an event has far more numbers.
};

struct ContactRow {
  std::int64_t episode = 0;
  double time_s = 0.0;  ///< When it began.
  double end_s = 0.0;
  double depth_m = 0.0;
  std::string link;
  std::string object;
  std::string cause;
};

/// What a results store holds of a replan experiment.
struct ReplanRows {
  std::string identity;  ///< The effective configuration that fixes every outcome, as YAML.
  std::vector<EpisodeRow> episodes;  ///< In ascending order.
  std::vector<ContactRow> contacts;
  std::vector<Replanner::GuessCount> guesses;  ///< Of all episodes together, in order of trial.
};

/// Series "run".
void record_replan_run(const std::string& identity, Recorder& recorder);

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
