#pragma once

#include <atomic>
#include <chrono>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include <sidestep/core/time.hpp>
#include <sidestep/measures/map_truth.hpp>
#include <sidestep/measures/swept_volume.hpp>
#include <sidestep/measures/track_truth.hpp>
#include <sidestep/measures/true_map.hpp>
#include <sidestep/runtime/map_show.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/run_observer.hpp>
#include <sidestep/runtime/sensor_set.hpp>
#include "replan_rows.hpp"
#include "replan_settings.hpp"

namespace sidestep {

/// The mapping side of an episode: frames that are due become fields in the world's slot, and are
/// shown by an executor that can. Once it has failed or its source has ended, it maps no more, and
/// the map ages.
class EpisodeMapping {
 public:
  /// `observer` may be null; it is shown nothing before show() says so.
  EpisodeMapping(ReplanWorld& world, const ReplanConfiguration& configuration, Log& log,
                 RunObserver* observer);

  /// Binds the field builder to the mapper. Call once, first.
  [[nodiscard]] Result<void> attach() { return pipeline_.attach(); }

  /// Maps the first frame, before the clock runs, or waits for it where a thread maps already; null
  /// where none comes by the deadline, which counts by the wall's clock only.
  std::shared_ptr<const DistanceField> map_first(const Deadline& deadline);

  /// In lockstep: maps the frame that is due, if any, and publishes what the latency has passed
  /// for.
  void advance(Stamp now);

  /// Whether the observer is shown what is mapped from now on. [any]
  void show(bool shows) noexcept { shows_ = shows; }

  /// By the wall's clock: maps in a thread until told to stop, unless it does already.
  void start();
  /// Stops and joins that thread, if there is one.
  void stop();

  /// Whether the mapper has what it takes to find what moves.
  [[nodiscard]] bool finds_what_moves() const noexcept { return occupancy_ != nullptr; }
  /// What keeps new maps from coming, as far as that is known. [any]
  [[nodiscard]] std::string trouble() const;

  /// The next three only in lockstep, or after stop().
  [[nodiscard]] const std::optional<Error>& fault() const noexcept { return fault_; }
  /// Hands over what was mapped since the last call.
  [[nodiscard]] MappingRecord take_record();
  /// Nothing where it was not measured.
  [[nodiscard]] std::optional<MapFollowing> following() const;

 private:
  struct Waiting {
    Stamp due;
    MapSnapshot snapshot;
  };

  /// The frame that was mapped last, in the map's frame.
  [[nodiscard]] std::shared_ptr<const Frame> mapped_frame(const MappingStep& step) const;
  /// Maps the next frame, if one comes before the deadline.
  bool map_one(const Deadline& deadline);
  void note_trouble(const Result<std::optional<MappingStep>>& step);
  void note_frame(MappingStep step);
  /// The map as nobody can see it, published as if it had been mapped.
  void give_truth();

  const Clock& clock_;
  bool is_lockstep_;
  GroundTruth* truth_source_;  ///< Instead of frames; null where those are mapped.
  LatencyEntry latency_;       ///< In lockstep.
  RunObserver* observer_;
  std::atomic<bool> shows_ = false;
  SnapshotSlot& slot_;
  SnapshotSlot made_;  ///< In lockstep: what has been made, but is not to be seen yet.
  SensorSet sensors_;
  MotionDetector motion_detector_;
  Tracker tracker_;
  std::optional<BaseJoints> base_;
  bool is_tracking_;
  bool masks_tracks_;
  std::string source_name_;
  MappingPipeline pipeline_;
  std::deque<Waiting> waiting_;
  Stamp busy_until_;
  bool has_ended_ = false;
  std::optional<Error> fault_;
  std::vector<MappedFrame> frames_;

  mutable std::mutex trouble_mutex_;  ///< Of the next two, which the side that maps writes.
  std::string trouble_;               ///< Empty: frames come, or are waited for.
  std::optional<Stamp> newest_;

  const OccupancyView* occupancy_;         ///< Of the mapper; null where it has none.
  std::optional<MapTruth> truth_;          ///< Where it is measured.
  std::optional<SweptVolume> swept_;       ///< The same.
  std::optional<TrackTruth> track_truth_;  ///< The same, where there are tracks.
  std::jthread thread_;
  std::unique_ptr<MapShow> show_;  ///< By the wall's clock, where the executor shows maps.
};

/// Tells people how far an episode has come, every few seconds of the wall's clock while it goes
/// on: by that clock one may take minutes. One thread.
class EpisodeProgress {
 public:
  using Wall = std::chrono::steady_clock;
  using Tell = std::function<void(const std::string& how_far)>;

  /// Of an episode that begins now, at `begin` of its own clock, and lasts `duration_s` at most.
  /// `tell` may be empty.
  EpisodeProgress(Tell tell, Stamp begin, double duration_s, Wall::time_point wall = Wall::now());

  /// After each step, the last one included.
  void note(Stamp now, Wall::time_point wall = Wall::now());

 private:
  Tell tell_;
  Stamp begin_;
  std::string limit_;
  Wall::time_point told_;
};

/// Asked after each step; why the episode is to end before its goal, or nothing.
using EpisodeWatch = std::function<std::string(Stamp now, const Replanner& replanner)>;

/// What an episode takes place in.
struct EpisodeParts {
  const ReplanConfiguration& settings;
  ReplanWorld& world;
  EpisodeMapping& mapping;         ///< Attached.
  EpisodeWatch watch;              ///< May be empty.
  EpisodeProgress::Tell progress;  ///< May be empty.
  /// For the certificates of what is followed, MOTION.json; empty: none.
  std::filesystem::path certificates = {};
};

/// Runs one episode: the closed loop of Finean 2021, Algorithm 1, by the clock that the settings
/// name, from where the clock is, and then what truly happened. Leaves the robot at rest and nobody
/// mapping. A task that fails, a plugin that fails while the robot moves, are a record with a
/// reason; an error is one that leaves nothing to measure. [main]
[[nodiscard]] Result<EpisodeRecord> run_episode(ExperimentContext& context,
                                                const EpisodeParts& parts, std::int64_t episode);

/// Where an episode leaves certificates, in the run's folder; empty where none are asked for.
[[nodiscard]] std::filesystem::path certificates_of(const ReplanConfiguration& settings,
                                                    const std::filesystem::path& run,
                                                    std::int64_t episode);

/// Certifies the motions of an episode, each for as long as it was followed, among what the map
/// held as it began, counts them, and leaves the certificates of those that are proven in a folder,
/// MOTION.json. Fails as leave_certificate() does.
[[nodiscard]] Result<void> certify_motions(const ReplanConfiguration& settings,
                                           const RobotModel& robot,
                                           const std::filesystem::path& folder,
                                           EpisodeRecord& episode);

}  // namespace sidestep
