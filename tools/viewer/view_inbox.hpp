#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <vector>

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
class ViewInbox {
 public:
  void begin(const ObservedWorld& world);
  void mapped(const ObservedMap& map);
  void stepped(const ObservedStep& step);
  void happened(const ObservedEvent& event);
  void end(const ObservedEnd& end);

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

}  // namespace sidestep
