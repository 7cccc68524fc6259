#include "replan_show.hpp"

namespace sidestep {
namespace {

/// Whether what is followed changes with an event.
bool changes_what_is_followed(ReplannerEvent::Kind kind) {
  return kind == ReplannerEvent::Kind::kPlanned || kind == ReplannerEvent::Kind::kReplanned ||
         kind == ReplannerEvent::Kind::kStopped || kind == ReplannerEvent::Kind::kSlowed;
}

}  // namespace

void EpisodeShow::begin(const std::string& title, std::int64_t episode) const {
  if (observer_ == nullptr) return;
  observer_->begin({title, episode, world_.robot, world_.scene, world_.q_start, world_.q_goal});
  mapping_.show(true);
}

void EpisodeShow::step(Stamp now, double step_ms, Replanner::Status status,
                       const Replanner& replanner, const EpisodeRecord& record) const {
  if (observer_ == nullptr) return;
  ObservedStep step{now, step_ms, status, replanner.checks(), {}, {}};
  const auto current =
      guarded(plugin_of(world_.executor), [&] { return world_.executor->current(); });
  if (current) step.q = current->state.q;
  if (!record.poses.empty()) step.q_true = record.poses.back().q;
  observer_->stepped(step);
}

void EpisodeShow::event(const EpisodeEvent& event, const Replanner& replanner) const {
  if (observer_ == nullptr) return;
  ObservedEvent shown{event.event, event.stamp_to_trajectory_ms, nullptr, {}};
  if (changes_what_is_followed(event.event.kind)) {
    shown.followed = std::make_shared<const Trajectory>(replanner.followed());
    shown.followed_start = replanner.followed_start();
  }
  observer_->happened(shown);
}

void EpisodeShow::end(const EpisodeRecord& record) const {
  if (observer_ == nullptr) return;
  mapping_.show(false);
  observer_->end({world_.clock->now(), record.success(),
                  record.success() ? "the robot is at its goal" : record.reason});
}

}  // namespace sidestep
