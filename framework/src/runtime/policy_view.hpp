#pragma once

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/runtime/loop_policies.hpp>

namespace sidestep::detail {

using Kind = ReplannerEvent::Kind;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;
using Call = ExecutorCall::Kind;

inline constexpr double kRounding = 1e-6;  ///< m, rad, s and per s.

// Promises of docs/closed_loop.md that several policies guard.
inline constexpr std::string_view kPromiseOnState =
    "Not known, older than `max_state_age_s`, or farther than `tracking_tolerance` from what is "
    "followed: stop.";
inline constexpr std::string_view kPromiseOnEvents = "What it noticed and did comes back as events";
inline constexpr std::string_view kPromiseOnValidity =
    "the whole motion from now on, the rest of the old one included, is valid in the map";
inline constexpr std::string_view kPromiseOnSending =
    "The executor is sent one trajectory from now on: the rest of what it follows, up to "
    "`takeover_s` from now, and then the new motion.";

inline const std::string kKept;  ///< What a policy says that is kept.

[[nodiscard]] inline double largest(const Eigen::VectorXd& values) {
  return values.size() == 0 ? 0.0 : values.cwiseAbs().maxCoeff();
}
[[nodiscard]] inline double seconds_between(Stamp from, Stamp to) {
  return to.seconds() - from.seconds();
}

/// What policies know of a loop besides its steps.
struct LoopSetup {
  std::shared_ptr<const RobotModel> robot;
  MotionLimits limits;
  SpacePolicy space;
  ReplannerSettings settings;
  std::vector<bool> fixed;  ///< Spheres that no joint moves.
};

/// What has been so far, up to the step that is judged.
struct LoopMemory {
  struct Search {
    Stamp stamp;
    std::shared_ptr<const DistanceField> field;
  };
  struct Checked {
    Stamp start;
    const DistanceField* field = nullptr;
    friend bool operator==(const Checked&, const Checked&) = default;
  };

  std::optional<LoopStep> last;
  std::optional<Stamp> first;
  Stamp newest_map;                          ///< Of those that were good.
  std::shared_ptr<const DistanceField> map;  ///< The last that was; null before the first.
  std::optional<ReplannerEvent> halted;      ///< A stop after which nothing has been planned.
  bool is_stopping = false;                  ///< What is followed is a stop.
  bool has_failed_stop = false;              ///< The executor's own.
  bool has_left = false;                     ///< The robot has stood within the margin once.
  std::optional<Search> search;
  std::optional<Stamp> looked_for_stop;
  std::optional<Stamp> planned_in;  ///< Stamp of the map of the last plan.
  std::optional<Checked> checked;
  std::optional<Eigen::VectorXd> plan_end;
  std::optional<Eigen::VectorXd> q_first;  ///< Where the robot was measured first.
};

/// A trajectory that the executor took, and what was told of it.
struct Sent {
  const Trajectory& trajectory;
  Stamp start;
  const ReplannerEvent& event;
  bool is_stop = false;
  double takeover_s = 0.0;  ///< On its clock: when it leaves what was followed before.
};

/// A step as policies look at it.
struct PolicyView {
  const LoopSetup& setup;
  const LoopMemory& memory;
  const LoopStep& step;

  [[nodiscard]] bool is_clock_back() const;
  /// Whether it is one in which the replanner had something to decide.
  [[nodiscard]] bool is_active() const;
  /// The state that was measured first in it; null where there was none.
  [[nodiscard]] const ExecutorCall* first_measurement() const;
  [[nodiscard]] bool is_senseless(const RobotState& state) const;
  /// Null where it is not known, makes no sense or is too old.
  [[nodiscard]] const Executor::Measured* state() const;
  [[nodiscard]] bool is_at_rest(const RobotState& state) const;
  /// What was followed as it began; null where nothing was.
  [[nodiscard]] const Trajectory* before() const;
  [[nodiscard]] double before_s(Stamp stamp) const;
  /// Nothing but a stop is followed after it.
  [[nodiscard]] bool stands_or_stops() const;
  [[nodiscard]] bool is_stopping_after() const;
  /// The first event of a search for a plan; null where there was none.
  [[nodiscard]] const ReplannerEvent* search() const;
  /// Whether the stop that it has is to be looked at: with each map and each motion, and a while
  /// after that.
  [[nodiscard]] bool looks_for_stop() const;
  [[nodiscard]] const ReplannerEvent* first_event(auto holds) const {
    const auto found = std::ranges::find_if(step.events, holds);
    return found == step.events.end() ? nullptr : &*found;
  }
  [[nodiscard]] const ExecutorCall* first_call(auto holds) const {
    const auto found = std::ranges::find_if(step.calls, holds);
    return found == step.calls.end() ? nullptr : &*found;
  }
  [[nodiscard]] std::optional<Sent> sent() const;
  /// Whether it may be judged in LoopStep::map.
  [[nodiscard]] bool has_map() const { return step.map.field != nullptr && !step.has_new_map; }
};

[[nodiscard]] inline bool is_plan(const ReplannerEvent& event) {
  return event.kind == Kind::kPlanned || event.kind == Kind::kReplanned;
}
[[nodiscard]] inline bool is_stop(const ReplannerEvent& event) {
  return event.kind == Kind::kSlowed || event.kind == Kind::kStopped;
}

/// By what a policy is broken where the robot has to stop in the step, and goes on.
[[nodiscard]] inline std::string stop_is_due(const PolicyView& view, bool is_due,
                                             const std::string& why) {
  const bool is_reached = view.step.status == Replanner::Status::kReached;
  return !is_due || is_reached || view.stands_or_stops() ? kKept : why + ", and the robot goes on";
}

struct Policy : LoopPolicy {
  std::string (*broken)(const PolicyView& view);  ///< By what; empty: it is kept.
};
/// What the replanner is given, and when it plans: policies_of_maps.cpp.
[[nodiscard]] std::span<const Policy> policies_of_maps();
/// What it sends: policies_of_motions.cpp.
[[nodiscard]] std::span<const Policy> policies_of_motions();
/// How it stops, and what it tells: policies_of_stops.cpp.
[[nodiscard]] std::span<const Policy> policies_of_stops();

// Motions, state by state: loop_motions.cpp. Each says what is wrong; empty where nothing is.

/// The least clearance of a motion that any sphere has at its begin, margins aside; infinity where
/// it has no sphere that moves.
[[nodiscard]] double clearance_at_start_m(const PolicyView& view, const Trajectory& motion,
                                          double from_s);
/// The last time of a motion from which a sphere moves by `way_m` until `to_s`, or its begin.
[[nodiscard]] double time_before_s(const PolicyView& view, const Trajectory& motion, double to_s,
                                   double way_m);
/// Whether spheres keep the margin from what the step's map has, from `from_s` to `to_s`: none of
/// it, and no less than at the begin, where the robot has stood within it once.
[[nodiscard]] std::string touches(const PolicyView& view, const Trajectory& motion, double from_s,
                                  double to_s);
/// The same of a stop along a motion that begins soon after `now_s`, and of the way there.
[[nodiscard]] std::string touches_until_rest(const PolicyView& view, const Trajectory& motion,
                                             double now_s);
/// Whether what moves in the step's map could reach the robot on every stop that it has.
[[nodiscard]] std::string is_reached(const PolicyView& view, const Trajectory& motion,
                                     double from_s);
[[nodiscard]] std::string meets_predicted(const PolicyView& view, const Sent& sent);
[[nodiscard]] std::string leaves_seen_space(const PolicyView& view, const Trajectory& motion);
[[nodiscard]] std::string leaves_joint_limits(const PolicyView& view, const Trajectory& motion,
                                              double until_s);
[[nodiscard]] std::string is_too_fast(const PolicyView& view, const Sent& sent);
/// Mean accelerations between two states, against the limit of motions, or of stops.
[[nodiscard]] std::string speeds_up_too_much(const PolicyView& view, const Sent& sent);

}  // namespace sidestep::detail
