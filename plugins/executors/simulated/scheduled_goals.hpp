#pragma once

#include <deque>

#include <sidestep/core/time.hpp>
#include <sidestep/planning/goal_source.hpp>

namespace sidestep::simulated {

/// Goals that come at times fixed beforehand.
class ScheduledGoals {
 public:
  /// Reads the parameter `goals`. Fails with kConfig, at the position, where an entry is no map,
  /// has no time, or one before that of the entry above it.
  [[nodiscard]] static Result<ScheduledGoals> read(const Node& goals);

  /// The last that is due; those before it, due since the last call, have been overtaken.
  [[nodiscard]] std::optional<GoalRequest> next(Stamp now);
  [[nodiscard]] bool is_empty() const noexcept { return waiting_.empty(); }

 private:
  struct Scheduled {
    double at_s = 0.0;
    GoalRequest request;
  };
  std::deque<Scheduled> waiting_;
};

}  // namespace sidestep::simulated
