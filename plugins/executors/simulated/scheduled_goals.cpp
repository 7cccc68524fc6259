#include "scheduled_goals.hpp"

#include <utility>

namespace sidestep::simulated {

Result<ScheduledGoals> ScheduledGoals::read(const Node& goals) {
  ScheduledGoals read;
  if (goals.is_null()) return read;
  if (!goals.is_list()) {
    return tl::make_unexpected(goals.error("expected a list of goals, found " + goals.kind(),
                                           "e.g. [{at_s: 2.0, goal: {joints: {odom_x: 1.0}}}]"));
  }
  for (const Node& entry : goals.items()) {
    const Node* at = entry.find("at_s");
    if (at == nullptr) {
      return tl::make_unexpected(
          entry.error("the goal has no `at_s`", "say when it comes, in seconds of the run"));
    }
    const auto at_s = SIDESTEP_TRY(at->as_double());
    if (!read.waiting_.empty() && at_s < read.waiting_.back().at_s) {
      return tl::make_unexpected(at->error("the goal comes before the one above it"));
    }
    Scheduled goal{at_s, {std::to_string(read.waiting_.size() + 1), {}}};
    Node::Map wish;
    for (const Node::Entry& part : entry.entries()) {
      if (part.key != "at_s") wish.push_back(part);
    }
    if (!wish.empty()) goal.request.wish = Node(std::move(wish), entry.mark());
    read.waiting_.push_back(std::move(goal));
  }
  return read;
}

std::optional<GoalRequest> ScheduledGoals::next(Stamp now) {
  std::optional<GoalRequest> newest;
  while (!waiting_.empty() && waiting_.front().at_s <= now.seconds()) {
    newest = std::move(waiting_.front().request);
    waiting_.pop_front();
  }
  return newest;
}

}  // namespace sidestep::simulated
