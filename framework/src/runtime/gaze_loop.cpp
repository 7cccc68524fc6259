#include <sidestep/runtime/gaze_loop.hpp>

#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/runtime/call_plugin.hpp>

#include "head_guard.hpp"

namespace sidestep {
namespace {

constexpr std::int64_t kPeriod_ns = 100'000'000;
/// Who did not listen is told again.
constexpr std::int64_t kAgain_ns = 1'000'000'000;
/// A head that is told where it was measured would sink by its own error each time.
constexpr double kSame_rad = 0.01;
/// A head that has stood for so long farther than this from where it was told to be is stuck.
constexpr std::int64_t kStuck_ns = 500'000'000;
constexpr double kOff_rad = 0.05;
/// Beyond this, nothing that a gaze sees comes into the map.
constexpr double kOldMap_s = 1.0;
/// A head that turns goes on for about so long at its speed until it is at rest.
constexpr double kStop_s = 0.4;
/// A head that is in the way of a motion rests for so long: for the next searches.
constexpr std::int64_t kRest_ns = 2'000'000'000;

double apart_rad(const HeadAngles& a, const HeadAngles& b) {
  return std::max(std::abs(a.pan_rad - b.pan_rad), std::abs(a.tilt_rad - b.tilt_rad));
}

}  // namespace

Result<GazeLoop> GazeLoop::create(Parts parts) {
  auto head = SIDESTEP_TRY(Head::create(parts.robot));
  auto* const turner = dynamic_cast<HeadTurner*>(&parts.executor);
  if (turner != nullptr) return GazeLoop(std::move(parts), std::move(head), *turner);
  return fail(ErrorCode::kUnsupported, parts.executor_name + " turns no head", "gaze");
}

GazeLoop::GazeLoop(Parts parts, Head head, HeadTurner& turner)
    : parts_(std::move(parts)),
      head_(std::move(head)),
      turner_(&turner),
      guard_(std::make_unique<HeadGuard>(parts_.robot, head_, parts_.margin_m)),
      T_world_link_(parts_.robot->description().links.size()) {}

GazeLoop::GazeLoop(GazeLoop&&) noexcept = default;
GazeLoop::~GazeLoop() = default;

bool GazeLoop::is_due(Stamp now) const noexcept {
  return !looked_ || now < *looked_ || now.ns - looked_->ns >= kPeriod_ns;
}

void GazeLoop::look(Stamp now, const RobotState& measured, const Replanner::Way& way) {
  looked_ = now;
  const auto turned = turn(now, measured, way);
  if (!turned && !has_failed_) {
    parts_.log.warn(turned.error().describe() + "; the head stays as it is");
  }
  has_failed_ = !turned;
}

Result<void> GazeLoop::turn(Stamp now, const RobotState& measured, const Replanner::Way& way) {
  parts_.robot->link_poses(as_span(measured.q), T_world_link_, scratch_);
  const HeadAngles at = head_at(now);
  const HeadAngles stop = head_stop(now);
  watch_head(now, at);
  guard_->see(as_span(measured.q), way.followed, way.followed_s, parts_.slot.snapshot().field);
  const auto asked = ask(now, measured, way, at, stop);
  const HeadAngles stay = told_.value_or(at);
  const HeadAngles wanted = apart(now, at, stop, asked.value_or(stay));
  if (asked || apart_rad(wanted, stay) >= kSame_rad) SIDESTEP_TRY(tell(now, wanted));
  if (!asked) return error_of(asked);
  return {};
}

Result<HeadAngles> GazeLoop::ask(Stamp now, const RobotState& measured, const Replanner::Way& way,
                                 const HeadAngles& at, const HeadAngles& stop) {
  const MapSnapshot map = parts_.slot.snapshot();
  // Only the floor may show that a camera is sound again whose frames are left out.
  const bool is_old = map.field && now.seconds() - map.field->info().stamp.seconds() > kOldMap_s;
  if (is_old) return head_.rest();
  GazeRequest request{now, *parts_.robot, measured, T_world_link_, head_, at};
  request.may_turn = [&](const HeadAngles& to) {
    return guard_->is_clear({at, stop, to}) || is_clear_by_rest(at, stop, to);
  };
  request.way = way.trajectory;
  request.way_from_s = way.from_s;
  request.way_blocked_s = way.blocked_s;
  request.field = map.field.get();
  request.tracks = map.tracks.get();
  request.moving = map.moving.get();
  if (map.camera) request.camera = &*map.camera;
  const HeadAngles to =
      SIDESTEP_TRY(call_stage(parts_.gaze_name, [&] { return parts_.gaze.look(request); }));
  if (std::isfinite(to.pan_rad) && std::isfinite(to.tilt_rad)) return head_.within_limits(to);
  return fail(ErrorCode::kPlugin, "said angles that are not numbers", "plugin " + parts_.gaze_name);
}

bool GazeLoop::is_clear_by_rest(const HeadAngles& at, const HeadAngles& stop,
                                const HeadAngles& to) {
  return guard_->is_clear({at, stop}) && guard_->is_clear({to});
}

HeadAngles GazeLoop::apart(Stamp now, const HeadAngles& at, const HeadAngles& stop,
                           const HeadAngles& asked) {
  const bool rests = now < rests_until_ && rests_until_.ns - now.ns <= kRest_ns;
  if (rests) return head_.rest();
  if (guard_->is_clear({at, stop, asked})) return asked;
  if (is_clear_by_rest(at, stop, asked)) return head_.rest();
  const HeadAngles told = told_.value_or(at);
  if (guard_->is_clear({at, stop, told})) return told;
  return guard_->is_clear({at, stop}) ? stop : head_.rest();
}

Result<void> GazeLoop::tell(Stamp now, HeadAngles wanted) {
  if (told_ && apart_rad(*told_, wanted) < kSame_rad) {
    if (now >= told_at_ && now.ns - told_at_.ns < kAgain_ns) return {};
    wanted = *told_;
  }
  SIDESTEP_TRY(call_stage(parts_.executor_name, [&] { return turner_->turn_head(wanted); }));
  told_ = wanted;
  told_at_ = now;
  return {};
}

void GazeLoop::watch_head(Stamp now, const HeadAngles& at) {
  const bool is_there = !told_ || apart_rad(at, *told_) < kOff_rad;
  if (is_there || !stood_at_ || apart_rad(at, *stood_at_) > kSame_rad || now < stood_since_) {
    is_stuck_ = false;
    stood_at_ = at;
    stood_since_ = now;
    return;
  }
  if (is_stuck_ || now.ns - stood_since_.ns < kStuck_ns) return;
  is_stuck_ = true;
  parts_.log.warn(parts_.executor_name + ": the head does not move: it was told to turn to " +
                  format("%.2f, ", told_->pan_rad) + format("%.2f rad", told_->tilt_rad) +
                  " and is at " + format("%.2f, ", at.pan_rad) + format("%.2f rad", at.tilt_rad) +
                  "; the robot goes on with it where it is");
}

HeadAngles GazeLoop::head_stop(Stamp now) const {
  const HeadAngles at = head_at(now);
  const HeadAngles before = parts_.motion.head({now.ns - kPeriod_ns}).value_or(at);
  const auto stop = [](double at_rad, double before_rad) {
    return at_rad + (at_rad - before_rad) * kStop_s * 1e9 / static_cast<double>(kPeriod_ns);
  };
  return head_.within_limits(
      {stop(at.pan_rad, before.pan_rad), stop(at.tilt_rad, before.tilt_rad)});
}

std::string GazeLoop::objection(Stamp now, const Trajectory& motion) {
  const HeadAngles at = head_at(now);
  const HeadAngles stop = head_stop(now);
  const HeadAngles told = told_.value_or(at);
  const auto is_at_rest = [&](const HeadAngles& angles) {
    return apart_rad(angles, head_.rest()) < kOff_rad;
  };
  if (is_at_rest(at) && is_at_rest(stop) && is_at_rest(told)) return {};  // as it was planned
  guard_->see(motion.q(0), &motion, 0.0, parts_.slot.snapshot().field);
  if (guard_->is_clear({at, stop, told})) return {};
  rests_until_ = {now.ns + kRest_ns};
  return is_stuck_ ? "the head is in its way, and does not move"
                   : "the head is in its way, and goes to rest";
}

}  // namespace sidestep
