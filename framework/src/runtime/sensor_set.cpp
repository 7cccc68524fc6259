#include <sidestep/runtime/sensor_set.hpp>

#include <algorithm>
#include <iterator>
#include <utility>

#include <sidestep/runtime/call_plugin.hpp>

namespace sidestep {
namespace {

/// How long one of several is asked for a frame, by the wall's clock.
constexpr double kTurn_s = 1e-3;
/// Nothing waits longer for a frame that was taken before.
constexpr double kLongestLatency_s = 0.2;
/// Shares of the newest in running means.
constexpr double kNewest = 0.05;
/// A slow sensor is silent only after so many of its periods.
constexpr double kSilentPeriods = 3.0;
/// How long a first or a second frame is waited for.
constexpr double kFirst_s = 1.0;

double since_s(Stamp then, Stamp now) { return now.seconds() - then.seconds(); }

}  // namespace

SensorSet::SensorSet(const std::vector<Sensor>& sensors, const Clock& clock, bool waits,
                     std::optional<double> floor_z_m,
                     const std::shared_ptr<const RobotModel>& robot, Log& log)
    : clock_(clock), waits_(waits), log_(log) {
  for (const Sensor& sensor : sensors) {
    sensors_.push_back({.frames = PacedFrames(sensor.source, clock, waits),
                        .name = sensor.name,
                        .is_needed = sensor.is_needed,
                        .check = SensorCheck(floor_z_m, robot)});
  }
}

Result<std::optional<Frame>> SensorSet::next(const Deadline& deadline) {
  const bool is_alone = sensors_.size() == 1;
  for (;;) {
    for (Watched& sensor : sensors_) {
      if (sensor.pending || sensor.has_ended) continue;
      auto asked = ask(sensor, is_alone ? deadline : Deadline::after_s(kTurn_s));
      const bool is_late = !asked && asked.error().code == ErrorCode::kDeadlineExceeded;
      if (!asked && (is_alone || !is_late)) return error_of(asked);
    }
    if (Watched* const sensor = due()) return pass_on(*sensor);
    if (std::ranges::all_of(sensors_, &Watched::has_ended)) return std::optional<Frame>();
    if (deadline.stop_requested()) return fail(ErrorCode::kCancelled, "mapping was cancelled");
    if (!waits_ || deadline.expired()) {
      return fail(ErrorCode::kDeadlineExceeded, "no frame was due in time");
    }
  }
}

Result<void> SensorSet::ask(Watched& sensor, const Deadline& deadline) {
  auto frame = call_stage(sensor.name, [&]() -> Result<std::optional<Frame>> {
    auto next = SIDESTEP_TRY(sensor.frames.next(deadline));
    if (!next) return next;
    auto sound = sensor.check.check(*next);
    const bool is_image = std::holds_alternative<DepthImage>(next->measurement);
    // Of cameras the first is held against the laser.
    if (sound && (!is_image || &sensor == sensors_.data())) sound = agreement_.check(*next);
    sensor.is_at_fault = !sound;
    if (!sound) return error_of(sound);
    return next;
  });
  if (frame && *frame) {
    sensor.received = clock_.now();
    const double latency_s =
        std::clamp(since_s((*frame)->stamp, sensor.received), 0.0, kLongestLatency_s);
    sensor.latency_s =
        std::max(latency_s, sensor.latency_s + kNewest * (latency_s - sensor.latency_s));
    sensor.pending = std::make_unique<Frame>(*std::move(*frame));
    return {};
  }
  if (!frame && (frame.error().code == ErrorCode::kDeadlineExceeded ||
                 frame.error().code == ErrorCode::kCancelled)) {
    return error_of(frame);
  }
  const bool is_alone = sensors_.size() == 1;
  if (!frame && frame.error().code == ErrorCode::kBadFrame) {
    if (is_alone) return error_of(frame);
    leave_out(sensor, frame.error());
    return {};
  }
  sensor.trouble = frame ? "it has no more frames" : frame.error().message;
  sensor.has_ended = true;
  const bool is_last = std::ranges::all_of(sensors_, &Watched::has_ended);
  if (!frame && is_last) return error_of(frame);
  return {};
}

/// Others that have a frame have a later one; those that have none may yet send one from before.
SensorSet::Watched* SensorSet::due() {
  Watched* oldest = nullptr;
  for (Watched& sensor : sensors_) {
    if (sensor.pending && (oldest == nullptr || sensor.pending->stamp < oldest->pending->stamp)) {
      oldest = &sensor;
    }
  }
  if (oldest == nullptr || !waits_) return oldest;
  const Stamp now = clock_.now();
  const double age_s = since_s(oldest->pending->stamp, now);
  const bool is_early = std::ranges::any_of(sensors_, [&](const Watched& sensor) {
    const bool is_alive = !sensor.has_ended && since_s(sensor.received, now) <= kFirst_s;
    return !sensor.pending && is_alive && sensor.latency_s > age_s;
  });
  return is_early ? nullptr : oldest;
}

Result<std::optional<Frame>> SensorSet::pass_on(Watched& sensor) {
  const std::unique_ptr<Frame> frame = std::move(sensor.pending);
  frame->sensor = static_cast<int>(&sensor - sensors_.data());
  const bool is_alone = sensors_.size() == 1;
  const Stamp now = clock_.now();
  if (!is_alone && first_ && frame->stamp < passed_) {
    leave_out(sensor, {ErrorCode::kBadFrame,
                       "its frames come after later ones of other sensors",
                       sensor.name,
                       {},
                       nullptr});
    return fail(ErrorCode::kDeadlineExceeded, "the frame came too late");
  }
  if (sensor.newest) {
    const double period_s = since_s(*sensor.newest, frame->stamp);
    const bool is_first = sensor.period_s == 0.0;
    if (is_first || !is_missing(sensor, now)) {
      sensor.period_s += (is_first ? 1.0 : kNewest) * (period_s - sensor.period_s);
    }
  }
  sensor.newest = frame->stamp;
  sensor.heard = sensor.received;
  sensor.trouble.clear();
  if (!first_) first_ = now;
  passed_ = frame->stamp;
  if (!is_alone) {
    if (const Watched* const missing = look_for_missing(now)) {
      return fail(ErrorCode::kBadFrame, "there is no map without " + why_missing(*missing));
    }
  }
  received_ = sensor.received;
  if (keeps_last_) last_ = std::make_shared<const Frame>(*frame);
  return std::optional<Frame>(std::in_place, std::move(*frame));
}

void SensorSet::leave_out(Watched& sensor, const Error& why) {
  // The same again and again is not told anew, even where each message has its frame's number.
  if (!sensor.trouble.empty()) return;
  sensor.trouble = why.message;
  log_.warn("left out: " + why.describe());
}

bool SensorSet::is_missing(const Watched& sensor, Stamp now) const {
  if (sensor.has_ended || sensor.is_at_fault) return true;
  if (sensor.pending) return false;
  if (!sensor.heard) return sensor.is_needed || (first_ && since_s(*first_, now) > kFirst_s);
  const double silent_s =
      sensor.period_s == 0.0 ? kFirst_s : std::max(kSilent_s, kSilentPeriods * sensor.period_s);
  return since_s(*sensor.heard, now) > silent_s;
}

std::string SensorSet::why_missing(const Watched& sensor) {
  if (!sensor.trouble.empty()) return sensor.name + ": " + sensor.trouble;
  if (!sensor.newest) return sensor.name + ", which has given no frame yet";
  return sensor.name + ", which has given no frame since that of " +
         std::to_string(sensor.newest->seconds()) + " s";
}

const SensorSet::Watched* SensorSet::look_for_missing(Stamp now) {
  const Watched* first = nullptr;
  for (Watched& sensor : sensors_) {
    const bool was_missing = std::exchange(sensor.is_missing, is_missing(sensor, now));
    if (sensor.is_missing && sensor.is_needed && first == nullptr) first = &sensor;
    if (sensor.is_missing && !was_missing && !sensor.is_needed) {
      log_.warn("the robot goes on without " + why_missing(sensor));
    }
    if (!sensor.is_missing && was_missing) log_.warn(sensor.name + " is back");
  }
  return first;
}

std::optional<std::int64_t> SensorSet::frame_count() const {
  return sensors_.size() == 1 ? sensors_.front().frames.frame_count() : std::nullopt;
}

std::int64_t SensorSet::take_span() noexcept {
  std::int64_t span = 0;
  for (Watched& sensor : sensors_) span += sensor.frames.take_span();
  return span;
}

std::vector<CameraView> SensorSet::take_views() {
  std::vector<CameraView> views;
  for (Watched& sensor : sensors_)
    std::ranges::move(sensor.frames.take_views(), std::back_inserter(views));
  std::ranges::stable_sort(views, {}, &CameraView::stamp_s);
  return views;
}

}  // namespace sidestep
