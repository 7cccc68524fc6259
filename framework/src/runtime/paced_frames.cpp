#include <sidestep/runtime/paced_frames.hpp>

#include <algorithm>
#include <cmath>
#include <thread>

#include <sidestep/mapping/frame_check.hpp>

namespace sidestep {
namespace {

constexpr double kLongestSleep_s = 2e-3;
/// For a source that does not wait for the clock to begin its work.
constexpr double kToBegin_s = 0.05;
constexpr double kToRead_s = 60.0;

/// Whether all that a frame says is that its measurements are wrong.
bool is_blind(const Frame& frame) {
  const auto is_wrong = [](float depth_m) { return std::isnan(depth_m); };
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    return !image->depth_m.empty() && std::ranges::all_of(image->depth_m, is_wrong);
  }
  const auto& points_m = std::get<PointCloud>(frame.measurement).points_m;
  return !points_m.empty() &&
         std::ranges::all_of(points_m, [](const auto& point) { return point.hasNaN(); });
}

}  // namespace

Result<std::optional<Frame>> PacedFrames::next(const Deadline& deadline) {
  if (!pending_) {
    auto frame = next_of_source(deadline);
    if (!frame || !*frame) return frame;
    pending_ = std::make_unique<Frame>(std::move(**frame));
  }
  if (!wait_until_due(*pending_, deadline)) {
    return fail(ErrorCode::kDeadlineExceeded, "no frame was due in time");
  }
  if (is_blind(*pending_)) {
    const std::unique_ptr<Frame> blind = std::move(pending_);
    return tl::make_unexpected(bad_frame(*blind, "none of its depths is a number"));
  }
  note(*pending_);
  const std::unique_ptr<Frame> due = std::move(pending_);
  return std::optional<Frame>(std::in_place, std::move(*due));
}

/// A source may say at once that it has nothing but bad frames, again and again: it is not asked
/// twice at one time.
Result<std::optional<Frame>> PacedFrames::next_of_source(const Deadline& deadline) {
  if (!waits_ && bad_at_ == clock_.now()) {
    return fail(ErrorCode::kDeadlineExceeded, "no usable frame was due in time");
  }
  auto frame = waits_ ? source_.next(deadline) : next_at_once();
  if (!frame && frame.error().code == ErrorCode::kBadFrame) {
    bad_at_ = clock_.now();
    if (waits_) std::this_thread::sleep_for(std::chrono::duration<double>(kLongestSleep_s));
  }
  return frame;
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
  if (!last_sequence_) first_sequence_ = frame.sequence;
  last_sequence_ = std::max(frame.sequence, last_sequence_.value_or(frame.sequence));
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    views_.push_back({frame.stamp.seconds(), frame.T_world_camera, image->camera});
  }
}

}  // namespace sidestep
