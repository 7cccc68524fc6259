#include "frame_feed.hpp"

#include <algorithm>

#include <sidestep/measures/source_facts.hpp>

namespace sidestep {

FrameFeed::FrameFeed(MakeSource make_source, Limits limits, Log& log, std::stop_token stop)
    : make_source_(std::move(make_source)), limits_(limits), log_(log), stop_(std::move(stop)) {}

Result<void> FrameFeed::open() {
  source_.reset();  // two at once may not be had, e.g. of a camera
  auto source = SIDESTEP_TRY(make_source_());
  source_.emplace(std::move(source));
  if (!scene_) {
    auto scene = SIDESTEP_TRY(true_scene(*source_));
    if (scene != nullptr) scene_ = *scene;
  }
  count_ = SIDESTEP_TRY(frame_count_of(*source_));
  if (count_) count_ = (*count_ + limits_.stride - 1) / limits_.stride;
  if (limits_.frames > 0) count_ = std::min(count_.value_or(limits_.frames), limits_.frames);
  read_ = 0;
  at_end_ = false;
  return {};
}

Result<void> FrameFeed::rewind() {
  at_ = 0;
  if (is_whole_) return {};
  window_.clear();
  SIDESTEP_TRY(open());
  SIDESTEP_TRY(fill());
  is_whole_ = at_end_;
  if (is_whole_) source_.reset();
  return {};
}

Result<void> FrameFeed::fill() {
  window_.clear();
  at_ = 0;
  while (static_cast<int>(window_.size()) < limits_.in_memory) {
    auto frame = SIDESTEP_TRY(read());
    if (frame == nullptr) {
      at_end_ = true;
      has_been_read_ = true;
      break;
    }
    window_.push_back(std::move(frame));
  }
  return {};
}

Result<std::shared_ptr<const Frame>> FrameFeed::read() {
  const std::int64_t last = limits_.frames > 0 ? limits_.frames * limits_.stride : 0;
  while (last == 0 || read_ < last) {
    // Asked to stop, the source fails; what was read until then is what there is.
    if (stop_.stop_requested()) break;
    auto frame = in_stage(plugin_of(*source_), [&] { return (*source_)->next(Deadline(stop_)); });
    if (!frame && frame.error().code == ErrorCode::kBadFrame) {
      ++read_;
      if (has_been_read_) continue;
      log_.warn("skipped: " + frame.error().describe());
      bad_frames_.push_back(std::move(frame.error()));
      continue;
    }
    if (!frame && stop_.stop_requested()) break;
    if (!frame) return error_of(frame);
    if (!*frame) break;
    if (read_++ % limits_.stride == 0) return std::make_shared<const Frame>(std::move(**frame));
  }
  return std::shared_ptr<const Frame>();
}

Result<std::shared_ptr<const Frame>> FrameFeed::peek() {
  if (at_ == window_.size() && !at_end_ && !is_whole_) {
    SIDESTEP_TRY(fill());
  }
  if (at_ == window_.size()) return std::shared_ptr<const Frame>();
  return window_[at_];
}

Result<std::shared_ptr<const Frame>> FrameFeed::next() {
  auto frame = peek();
  if (frame && *frame != nullptr) ++at_;
  return frame;
}

Result<FrameFeed::Taken> FrameFeed::next_newest(double now_s) {
  Taken taken;
  for (;;) {
    auto frame = SIDESTEP_TRY(next());
    if (frame == nullptr) return taken;
    if (taken.frame != nullptr) ++taken.late;
    taken.frame = std::move(frame);
    const auto after = SIDESTEP_TRY(peek());
    if (after == nullptr || after->stamp.seconds() > now_s) return taken;
  }
}

Result<std::optional<Frame>> OneFrameSource::next(const Deadline&) {
  if (frame_ == nullptr) return std::optional<Frame>();
  std::optional<Frame> frame(*frame_);
  frame_.reset();
  return frame;
}

}  // namespace sidestep
