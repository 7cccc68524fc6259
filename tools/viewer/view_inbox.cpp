#include "view_inbox.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace sidestep {
namespace {

template <class Value>
void push_bounded(std::deque<Value>& queue, const Value& value) {
  if (queue.size() == EpisodeNews::kMostTimes) queue.pop_front();
  queue.push_back(value);
}

}  // namespace

EpisodeNews& ViewInbox::current() {
  if (news_.empty()) news_.emplace_back();
  return news_.back();
}

void ViewInbox::add_counts() {
  if (news_.empty()) return;
  news_.back().checks = counters_.checks;
  news_.back().frames_dropped = counters_.frames_dropped;
}

void ViewInbox::begin(const ObservedWorld& world) {
  EpisodeNews fresh;
  fresh.world = world;
  EpisodeNews oldest;  // freed outside the lock
  const std::lock_guard lock(mutex_);
  add_counts();
  if (news_.size() == kMostEpisodes) {
    oldest = std::move(news_.front());
    news_.erase(news_.begin());
  }
  news_.push_back(std::move(fresh));
  counters_ = {};
}

void ViewInbox::mapped(const ObservedMap& map) {
  std::optional<NewestMap> newest(NewestMap{map.frame, map.snapshot.field, map.published});
  const std::int64_t number = map.step.frame_sequence;
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  std::swap(news.map, newest);  // what was there is freed after the lock: declared before it
  push_bounded(news.frames, {map.step.stamp.seconds(), map.received.seconds(),
                             map.published.seconds(), map.step.integrate_ms, map.step.field_ms});
  if (counters_.last_frame) {
    counters_.frames_dropped += std::max<std::int64_t>(0, number - *counters_.last_frame - 1);
  }
  counters_.last_frame = number;
}

void ViewInbox::stepped(const ObservedStep& step) {
  const auto tenth = static_cast<std::int64_t>(std::floor(10.0 * step.stamp.seconds()));
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  news.step = step;
  counters_.checks = step.checks;
  if (tenth != counters_.tenth) {
    if (counters_.tenth >= 0) push_bounded(news.steps, counters_.longest);
    counters_.tenth = tenth;
    counters_.longest = {step.stamp.seconds(), step.step_ms};
  } else if (step.step_ms > counters_.longest[1]) {
    counters_.longest = {step.stamp.seconds(), step.step_ms};
  }
}

void ViewInbox::happened(const ObservedEvent& event) {
  ObservedEvent copy = event;
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  if (news.events.size() == EpisodeNews::kMostEvents) {
    if (news.events.front().followed != nullptr) news.plan = std::move(news.events.front());
    news.events.pop_front();
  }
  news.events.push_back(std::move(copy));
}

void ViewInbox::end(const ObservedEnd& end) {
  const std::lock_guard lock(mutex_);
  EpisodeNews& news = current();
  news.end = end;
  if (counters_.tenth >= 0) push_bounded(news.steps, counters_.longest);
  counters_.tenth = -1;
}

std::vector<EpisodeNews> ViewInbox::take() {
  std::vector<EpisodeNews> taken;
  const std::lock_guard lock(mutex_);
  add_counts();
  std::swap(taken, news_);
  return taken;
}

}  // namespace sidestep
