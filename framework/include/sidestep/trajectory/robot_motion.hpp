#pragma once

#include <deque>
#include <mutex>
#include <optional>

#include <sidestep/core/export.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/head.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {

/// A robot's past, present and planned motion, as its executor knows it. A camera on the robot
/// reads its pose at an image's stamp, a head where it will be. [any] thread.
class SIDESTEP_EXPORT RobotMotion {
 public:
  /// Keeps what was measured over this long.
  explicit RobotMotion(double history_s = 5.0) : history_s_(history_s) {}

  /// Adds a measured state, at rest where `qdot` is empty. One that is not newer than the last is
  /// dropped.
  void record(const RobotState& state, Stamp stamp);

  /// Adds a true state in the same way, where it is known apart from the measured one.
  void record_truth(const RobotState& state, Stamp stamp);

  /// What is being followed from now on, its time 0 at `start`; an empty trajectory: nothing.
  void follow(Trajectory trajectory, Stamp start);

  /// The measured state at a time, interpolated between its neighbours (cubic Hermite); nothing
  /// before the first, before what is kept, or after the newest.
  [[nodiscard]] std::optional<RobotState> measured(Stamp stamp) const;
  [[nodiscard]] std::optional<Stamp> newest() const;

  /// The true state at a time, likewise; the measured one where no true state has been recorded.
  [[nodiscard]] std::optional<RobotState> truth(Stamp stamp) const;

  /// Where the robot is to be at a time by what it follows; its ends, at rest, beyond them. Nothing
  /// where it follows nothing.
  [[nodiscard]] std::optional<RobotState> planned(Stamp stamp) const;

  /// Adds where the robot's head was. One that is not newer than the last is dropped.
  void record_head(const HeadAngles& angles, Stamp stamp);
  /// Where its head was at a time, between its neighbours, or beyond the newest as in that; nothing
  /// before the first and before what is kept.
  [[nodiscard]] std::optional<HeadAngles> head(Stamp stamp) const;

 private:
  template <class State>
  struct Sample {
    Stamp stamp;
    State state;
  };
  template <class State>
  using HistoryOf = std::deque<Sample<State>>;
  using History = HistoryOf<RobotState>;

  /// Drops what is older than is kept, but for one sample: the whole span can be interpolated.
  template <class State>
  void keep(HistoryOf<State>& history, Stamp newest) const {
    const std::int64_t oldest_ns = newest.ns - Stamp::from_seconds(history_s_).ns;
    while (history.size() > 1 && history[1].stamp.ns <= oldest_ns) history.pop_front();
  }

  void add(History& history, const RobotState& state, Stamp stamp) const;
  [[nodiscard]] static std::optional<RobotState> at(const History& history, Stamp stamp);

  double history_s_;
  mutable std::mutex mutex_;
  History measured_;
  History true_;
  HistoryOf<HeadAngles> head_;
  Trajectory followed_;
  Stamp start_;
};

}  // namespace sidestep
