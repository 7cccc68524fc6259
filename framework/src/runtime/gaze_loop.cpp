#include <sidestep/runtime/gaze_loop.hpp>

#include <cmath>
#include <utility>

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
/// A head that turns goes on for about so long at its speed until it is at rest.
constexpr double kStop_s = 0.4;
/// A head that is in the way of a motion rests for so long: for the next searches.
constexpr std::int64_t kRest_ns = 2'000'000'000;

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
      guard_(std::make_shared<HeadGuard>(parts_.robot, head_)),
      T_world_link_(parts_.robot->description().links.size()) {}

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
  const MapSnapshot map = parts_.slot.snapshot();
  parts_.robot->link_poses(as_span(measured.q), T_world_link_, scratch_);
  const HeadAngles at = head_at(now);
  const HeadAngles stop = head_stop(now);
  guard_->see(as_span(measured.q), way.trajectory, way.from_s);
  const auto by_rest = [&](const HeadAngles& angles) {
    return guard_->is_clear({at, stop}) && guard_->is_clear({angles});
  };
  GazeRequest request{now, *parts_.robot, measured, T_world_link_, head_, at};
  request.may_turn = [&](const HeadAngles& angles) {
    return guard_->is_clear({at, stop, angles}) || by_rest(angles);
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
  if (!std::isfinite(to.pan_rad) || !std::isfinite(to.tilt_rad)) {
    return fail(ErrorCode::kPlugin, "said angles that are not numbers",
                "plugin " + parts_.gaze_name);
  }
  HeadAngles wanted = head_.rest();
  const HeadAngles asked = head_.within_limits(to);
  if (now >= rests_until_ && guard_->is_clear({at, stop, asked})) {
    wanted = asked;
  } else if (now >= rests_until_ && guard_->is_clear({at, stop}) && !by_rest(asked)) {
    wanted = head_.within_limits(stop);
  }
  const auto is_same = [](double a_rad, double b_rad) {
    return std::abs(a_rad - b_rad) < kSame_rad;
  };
  if (told_ && is_same(told_->pan_rad, wanted.pan_rad) &&
      is_same(told_->tilt_rad, wanted.tilt_rad)) {
    if (now >= told_at_ && now.ns - told_at_.ns < kAgain_ns) return {};
    wanted = *told_;
  }
  SIDESTEP_TRY(call_stage(parts_.executor_name, [&] { return turner_->turn_head(wanted); }));
  told_ = wanted;
  told_at_ = now;
  return {};
}

HeadAngles GazeLoop::head_stop(Stamp now) const {
  const HeadAngles at = head_at(now);
  const HeadAngles before = head_at({now.ns - kPeriod_ns});
  const auto stop = [](double at_rad, double before_rad) {
    return at_rad + (at_rad - before_rad) * kStop_s * 1e9 / static_cast<double>(kPeriod_ns);
  };
  return {stop(at.pan_rad, before.pan_rad), stop(at.tilt_rad, before.tilt_rad)};
}

std::string GazeLoop::objection(Stamp now, const Trajectory& motion) {
  const HeadAngles at = head_at(now);
  const HeadAngles told = told_.value_or(at);
  guard_->see(motion.q(0), &motion, 0.0);
  if (guard_->is_clear({at, head_stop(now), told})) return {};
  rests_until_ = {now.ns + kRest_ns};
  return "the head is in its way, and goes to rest";
}

}  // namespace sidestep
