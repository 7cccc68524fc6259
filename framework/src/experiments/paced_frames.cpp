#include "paced_frames.hpp"

#include <algorithm>
#include <thread>

namespace sidestep {
namespace {

constexpr double kLongestSleep_s = 2e-3;
/// For a source that does not wait for the clock to begin its work.
constexpr double kToBegin_s = 0.05;
constexpr double kToRead_s = 60.0;

}  // namespace

Result<std::optional<Frame>> PacedFrames::next(const Deadline& deadline) {
  if (!pending_) {
    auto frame = waits_ ? source_.next(deadline) : next_at_once();
    if (!frame || !*frame) return frame;
    pending_ = std::make_unique<Frame>(std::move(**frame));
  }
  if (!wait_until_due(*pending_, deadline)) {
    return fail(ErrorCode::kDeadlineExceeded, "no frame was due in time");
  }
  note(*pending_);
  if (keeps_last_) last_ = *pending_;
  const std::unique_ptr<Frame> due = std::move(pending_);
  return std::optional<Frame>(std::in_place, std::move(*due));
}

/// A source that keeps to the clock has what is due even if no time is left, and would wait for the
/// rest; another one is never late, but does not begin without time.
Result<std::optional<Frame>> PacedFrames::next_at_once() {
  if (!keeps_to_clock_ || *keeps_to_clock_) {
    auto frame = source_.next(Deadline::after_s(0.0));
    const bool is_late = !frame && frame.error().code == ErrorCode::kDeadlineExceeded;
    if (frame && *frame) keeps_to_clock_ = true;
    if (!is_late || keeps_to_clock_.has_value()) return frame;
  }
  auto frame = source_.next(Deadline::after_s(keeps_to_clock_ ? kToRead_s : kToBegin_s));
  if (frame && *frame) keeps_to_clock_ = false;
  return frame;
}

bool PacedFrames::wait_until_due(const Frame& frame, const Deadline& deadline) const {
  for (;;) {
    const double left_s = frame.stamp.seconds() - clock_.now().seconds();
    if (left_s <= 0.0) return true;
    if (!waits_ || deadline.expired()) return false;
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(left_s, kLongestSleep_s)));
  }
}

void PacedFrames::note(const Frame& frame) {
  received_ = clock_.now();
  if (!last_sequence_) first_sequence_ = frame.sequence;
  last_sequence_ = std::max(frame.sequence, last_sequence_.value_or(frame.sequence));
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    views_.push_back({frame.stamp.seconds(), frame.T_world_camera, image->camera});
  }
}

}  // namespace sidestep
