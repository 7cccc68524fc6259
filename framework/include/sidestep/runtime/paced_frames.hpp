#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/sensing/source.hpp>

namespace sidestep {

/// Passes on the frames of another source when their time has come on the clock, whether that
/// source keeps to the clock itself or not; keeps where the camera was.
/// [mapping]
class PacedFrames final : public Source {
 public:
  /// `waits`: until a frame is due or the deadline has passed; else it is due or it is not.
  PacedFrames(Source& source, const Clock& clock, bool waits)
      : source_(source), clock_(clock), waits_(waits) {}

  /// Fails with kDeadlineExceeded where no frame is due in time; what does not wait needs none.
  /// With kBadFrame, in addition to what the source says, for a frame that measured nothing at all:
  /// the map would be none the newer for it.
  [[nodiscard]] Result<std::optional<Frame>> next(const Deadline& deadline) override;
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override {
    return source_.frame_count();
  }

  /// Frames of the source from the first to the last that was passed on since the last call, those
  /// left out included.
  [[nodiscard]] std::int64_t take_span() noexcept {
    if (!last_sequence_) return 0;
    return *last_sequence_ + 1 - std::exchange(first_sequence_, *last_sequence_ + 1);
  }
  /// Where the camera was since the last call.
  [[nodiscard]] std::vector<CameraView> take_views() noexcept { return std::exchange(views_, {}); }

 private:
  [[nodiscard]] Result<std::optional<Frame>> next_of_source(const Deadline& deadline);
  [[nodiscard]] Result<std::optional<Frame>> next_at_once();
  [[nodiscard]] bool wait_until_due(const Frame& frame, const Deadline& deadline) const;
  void note(const Frame& frame);

  Source& source_;
  const Clock& clock_;
  bool waits_;
  std::optional<bool> keeps_to_clock_;  ///< The source; nothing before its first frame.
  std::unique_ptr<Frame> pending_;
  std::optional<Stamp> bad_at_;  ///< When the source last had a frame that cannot be used.
  std::optional<std::int64_t> last_sequence_;
  std::int64_t first_sequence_ = 0;
  std::vector<CameraView> views_;
};

}  // namespace sidestep
