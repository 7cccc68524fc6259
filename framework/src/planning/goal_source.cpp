#include <sidestep/planning/goal_source.hpp>

namespace sidestep {

std::string_view to_string(GoalReport::State state) noexcept {
  switch (state) {
    case GoalReport::State::kAccepted: return "accepted";
    case GoalReport::State::kRefused: return "refused";
    case GoalReport::State::kActive: return "active";
    case GoalReport::State::kReached: return "reached";
    case GoalReport::State::kFailed: return "failed";
    case GoalReport::State::kReplaced: return "replaced";
  }
  return "unknown";
}

}  // namespace sidestep
