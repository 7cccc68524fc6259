#pragma once

#include <atomic>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include <sidestep/measures/map_truth.hpp>
#include <sidestep/runtime/map_show.hpp>
#include <sidestep/runtime/paced_frames.hpp>
#include <sidestep/runtime/pipeline.hpp>
#include <sidestep/runtime/run_observer.hpp>
#include "replan_types.hpp"
#include "replan_world.hpp"

namespace sidestep {

/// The mapping side of an episode: frames that are due become fields in the slot, and are shown by
/// an executor that can. Once it has failed or its source has ended, it maps no more, and the map
/// ages.
class EpisodeMapping {
 public:
  /// `observer` may be null; it is shown nothing before show() says so.
  EpisodeMapping(ReplanWorld& world, const ReplanSettings& settings, SnapshotSlot& slot, Log& log,
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

  /// Maps the next frame, if one comes before the deadline.
  bool map_one(const Deadline& deadline);
  void note_trouble(const Result<std::optional<MappingStep>>& step);
  void note_frame(MappingStep step);

  const Clock& clock_;
  bool is_lockstep_;
  double latency_s_;  ///< In lockstep: from a frame to its map.
  RunObserver* observer_;
  std::atomic<bool> shows_ = false;
  SnapshotSlot& slot_;
  SnapshotSlot made_;  ///< In lockstep: what has been made, but is not to be seen yet.
  PacedFrames source_;
  MotionDetector motion_detector_;
  MappingPipeline pipeline_;
  std::deque<Waiting> waiting_;
  Stamp busy_until_;
  bool has_ended_ = false;
  std::optional<Error> fault_;
  std::vector<MappedFrame> frames_;

  /// What trouble() tells of, written by the side that maps.
  struct Condition {
    std::string trouble;  ///< Empty: frames come, or are waited for.
    std::optional<Stamp> newest;
  };
  std::string source_name_;
  mutable std::mutex condition_mutex_;
  Condition condition_;
  std::size_t bad_frames_ = 0;  ///< Of the pipeline's, those that have been noted.

  const OccupancyView* occupancy_;  ///< Of the mapper; null where it has none.
  std::optional<MapTruth> truth_;   ///< Where it is measured.
  std::jthread thread_;
  std::unique_ptr<MapShow> show_;  ///< By the wall's clock, where the executor shows maps.
};

}  // namespace sidestep
