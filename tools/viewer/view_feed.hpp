#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <sidestep/core/log.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "view_messages.hpp"

namespace sidestep {

/// The newest map, without what a viewer does not show.
struct NewestMap {
  std::shared_ptr<const Frame> frame;
  std::shared_ptr<const DistanceField> field;
  Stamp published;
};

/// What an episode told since it was last asked.
struct EpisodeNews {
  std::optional<ObservedWorld> world;        ///< Where the episode has begun since.
  std::optional<NewestMap> map;              ///< The newest one.
  std::optional<ObservedStep> step;          ///< The newest one.
  std::optional<ObservedEvent> plan;         ///< The newest with a trajectory before `events`.
  std::deque<ObservedEvent> events;          ///< The newest kMostEvents.
  std::deque<std::array<double, 5>> frames;  ///< As in ViewTiming; the newest kMostTimes.
  std::deque<std::array<double, 2>> steps;   ///< The same.
  std::int64_t checks = 0;
  std::int64_t frames_dropped = 0;
  std::optional<ObservedEnd> end;

  static constexpr std::size_t kMostEvents = 64;
  static constexpr std::size_t kMostTimes = 600;
};

/// Where the robot's threads leave what they tell, and the feed's thread fetches it. No method
/// holds the lock for longer than it takes to move a few pointers. [any]
class ViewInbox : public RunObserver {
 public:
  void begin(const ObservedWorld& world) override;
  void mapped(const ObservedMap& map) override;
  void stepped(const ObservedStep& step) override;
  void happened(const ObservedEvent& event) override;
  void end(const ObservedEnd& end) override;

  /// What was told since the last call: episode by episode, the newest kMostEpisodes.
  [[nodiscard]] std::vector<EpisodeNews> take();

  static constexpr std::size_t kMostEpisodes = 4;

 private:
  /// Of one episode.
  struct Counters {
    std::int64_t checks = 0;
    std::int64_t frames_dropped = 0;
    std::optional<std::int64_t> last_frame;  ///< Its number.
    std::int64_t tenth = -1;                 ///< Of a second, in which `longest` is.
    std::array<double, 2> longest{};         ///< As in ViewTiming::steps.
  };
  EpisodeNews& current();
  void add_counts();

  std::mutex mutex_;
  std::vector<EpisodeNews> news_;
  Counters counters_;
};

/// How often each kind is made, at most, Hz.
struct ViewRates {
  double state_hz = 30.0;
  double map_hz = 10.0;  ///< And tracks, and slices.
  double frame_hz = 5.0;
  double timing_hz = 4.0;
};

/// Makes messages of what a run tells, for whoever wants them. Time is handed in. [one thread]
class ViewMaker {
 public:
  using TimePoint = std::chrono::steady_clock::time_point;

  explicit ViewMaker(std::vector<ViewSink*> sinks, const ViewRates& rates = {});

  /// Whether anybody reads; asks all sinks.
  [[nodiscard]] bool is_wanted();

  /// Takes over the news, hands worlds, events and plans on, and makes what is due of the rest;
  /// then greets newcomers. May throw what the robot's plugin throws.
  void make(TimePoint now, std::vector<EpisodeNews> news);

 private:
  /// What newcomers are sent, in this order; the map is made for them.
  enum Slot { kWorld, kState, kTracks, kFrame, kFollowed, kRefused, kEvent, kTiming, kEnd, kSlots };
  struct Rate {
    std::chrono::nanoseconds period;
    TimePoint next{};

    /// A little early counts as due: whoever looks does so at intervals of its own.
    bool due(TimePoint now, bool force) {
      if (!force && now + period / 4 < next) return false;
      next = (force || now - next > period ? now : next) + period;
      return true;
    }
  };

  void begin_episode(const ObservedWorld& world);
  void take_over(EpisodeNews& news);
  void tell_events(EpisodeNews& news);
  void tell_plan(Slot role, Stamp time, const Trajectory* trajectory, Stamp start);
  void make_due(TimePoint now, bool force);
  void make_state();
  void make_tracks();
  void make_map(TimePoint now);
  void make_frame();
  void make_timing();
  void make_slices(bool is_new_map);
  void greet();
  void publish(Slot slot, ViewMessage message);

  std::vector<ViewSink*> sinks_;
  std::vector<ViewSink::Demand> demands_;  ///< Of the sinks.
  Rate state_rate_, map_rate_, tracks_rate_, frame_rate_, timing_rate_;

  std::optional<ObservedWorld> world_;
  std::unique_ptr<RobotClearance> clearance_;
  std::vector<double> q_;  ///< The newest known; drawn.
  OccupancyBits bits_;
  std::optional<NewestMap> map_;
  std::optional<ObservedStep> step_;
  /// As they were told last.
  std::shared_ptr<const Tracks> tracks_;
  std::shared_ptr<const Prediction> prediction_;
  ViewTiming timing_;
  /// What has come since its message was made.
  bool has_new_map_ = false, has_new_frame_ = false, has_new_step_ = false, has_new_times_ = false;
  Stamp bits_stamp_, bits_time_;  ///< Of the field in bits_.
  std::array<std::optional<ViewMessage>, kSlots> newest_;
  std::vector<std::pair<ViewSink*, SliceRequest>> slices_;  ///< That were served last.
};

/// Looks on while a run goes on, and hands what it sees to sinks. What the robot's threads call
/// leaves pointers in an inbox and returns; a thread of low priority makes messages of them, at its
/// own pace, and nothing while nobody reads.
class ViewFeed final : public ViewInbox {
 public:
  /// Starts the thread. Sinks and log outlive the feed.
  ViewFeed(std::vector<ViewSink*> sinks, Log& log, const ViewRates& rates = {});
  ~ViewFeed() override;

  /// Hands over what is left, and ends the thread. [main]
  void finish();

 private:
  void work(const std::stop_token& stop);
  bool make_once();

  ViewMaker maker_;
  Log& log_;
  std::chrono::nanoseconds period_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace sidestep
