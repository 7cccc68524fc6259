#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <sidestep/core/export.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

/// A requested goal, in configuration syntax.
struct GoalRequest {
  std::string id;  ///< Whose it is: reports carry it.
  /// A map of what the block of a replan experiment may say of its goal: `goal` {pose, joints},
  /// `end_effector`, `orientation_costs`, `axis_costs`, `posture_cost`. Joints that it says nothing
  /// of stay as they are. Null: the robot is to stop, and to have no goal.
  Node wish;
};

/// Status of a request.
struct GoalReport {
  enum class State {
    kAccepted,  ///< It is the goal now.
    kRefused,   ///< It is invalid; `message` says why.
    kActive,    ///< On the way; once in a while.
    kReached,   ///< The robot is at rest there.
    kFailed,    ///< The robot has come to rest elsewhere, and tries no more.
    kReplaced,  ///< Another request came, or one to stop.
  };
  std::string id;
  State state = State::kAccepted;
  std::string message;          ///< In plain words.
  double farthest_joint = 0.0;  ///< Distance of the joint that has most left to go, m or rad.
};
[[nodiscard]] std::string_view to_string(GoalReport::State state) noexcept;

/// Optional interface of an executor: goals that arrive at run time, e.g. over a robot's own
/// network.
class SIDESTEP_EXPORT GoalSource {
 public:
  virtual ~GoalSource() = default;

  /// The newest request since the last call; nothing where none came. Does not wait. [planning]
  [[nodiscard]] virtual std::optional<GoalRequest> next_goal() = 0;

  /// Reports to the sender of the goal. [planning]
  virtual void report(const GoalReport& report) = 0;

  /// Whether requests may still come; without, a run ends once its last goal is done with.
  /// [planning]
  [[nodiscard]] virtual bool is_open() const = 0;
};

}  // namespace sidestep
