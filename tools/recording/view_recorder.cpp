#include "view_recorder.hpp"

#include <algorithm>

namespace sidestep {

void ViewRecorder::begin(const ObservedWorld& world) {
  constexpr std::chrono::seconds kBetweenEpisodes{1};
  begin_ = last_ = last_ + kBetweenEpisodes;
  inbox_.begin(world);  // Its clock is not known before anything has a stamp.
}

void ViewRecorder::mapped(const ObservedMap& map) {
  inbox_.mapped(map);
  make(map.published);
}

void ViewRecorder::stepped(const ObservedStep& step) {
  inbox_.stepped(step);
  make(step.stamp);
}

void ViewRecorder::happened(const ObservedEvent& event) {
  inbox_.happened(event);
  make(event.event.stamp);
}

void ViewRecorder::end(const ObservedEnd& end) {
  inbox_.end(end);
  make(end.stamp);
}

void ViewRecorder::make(Stamp stamp) {
  made_ = stamp;
  last_ = std::max(last_, begin_ + std::chrono::nanoseconds(stamp.ns));
  if (maker_.is_wanted()) maker_.make(last_, inbox_.take());
}

}  // namespace sidestep
