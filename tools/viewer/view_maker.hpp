#pragma once

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "view_inbox.hpp"
#include "view_sink.hpp"

namespace sidestep {

/// How often each kind is made, at most, Hz.
struct ViewRates {
  double state_hz = 30.0;
  double map_hz = 10.0;  ///< And slices.
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
  enum Slot { kWorld, kState, kFrame, kFollowed, kRefused, kEvent, kTiming, kEnd, kSlots };
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
  void make_map(TimePoint now);
  void make_frame();
  void make_timing();
  void make_slices(bool is_new_map);
  void greet();
  void publish(Slot slot, ViewMessage message);

  std::vector<ViewSink*> sinks_;
  std::vector<ViewSink::Demand> demands_;  ///< Of the sinks.
  Rate state_rate_, map_rate_, frame_rate_, timing_rate_;

  std::optional<ObservedWorld> world_;
  std::unique_ptr<RobotClearance> clearance_;
  std::vector<double> q_;  ///< The newest known; drawn.
  OccupancyBits bits_;
  std::optional<NewestMap> map_;
  std::optional<ObservedStep> step_;
  ViewTiming timing_;
  /// What has come since its message was made.
  bool has_new_map_ = false, has_new_frame_ = false, has_new_step_ = false, has_new_times_ = false;
  Stamp bits_stamp_, bits_time_;  ///< Of the field in bits_.
  std::array<std::optional<ViewMessage>, kSlots> newest_;
  std::vector<std::pair<ViewSink*, SliceRequest>> slices_;  ///< That were served last.
};

}  // namespace sidestep
