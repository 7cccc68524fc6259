#include "told_motion.hpp"

#include <utility>

#include <sidestep/trajectory/braking.hpp>

namespace sidestep::ros1_executor {

void ToldMotion::set(Trajectory trajectory, Stamp start) {
  trajectory_ = std::move(trajectory);
  start_ = start;
}

std::optional<RobotState> ToldMotion::at(Stamp now) const {
  if (is_empty()) return {};
  RobotState state{Eigen::VectorXd(trajectory_.dof), Eigen::VectorXd(trajectory_.dof)};
  const double at_s = since_start_s(now);
  const auto dof = static_cast<std::size_t>(trajectory_.dof);
  trajectory_.sample(at_s, {state.q.data(), dof}, {state.qdot.data(), dof});
  if (at_s < 0.0 || at_s > trajectory_.duration_s()) state.qdot.setZero();
  return state;
}

Trajectory stopping(const ToldMotion& told, const std::optional<Executor::Measured>& measured,
                    double tolerance, const MotionLimits& limits, Stamp now) {
  const auto plan = told.at(now);
  // The newest state may be of a while ago.
  const auto plan_then = measured ? told.at(measured->stamp) : std::nullopt;
  const bool is_off =
      plan_then && (plan_then->q - measured->state.q).cwiseAbs().maxCoeff() > tolerance;
  if (told.is_under_way(now) && !is_off && told.since_start_s(now) >= 0.0) {
    if (auto along = brake(told.trajectory(), told.since_start_s(now), limits)) return *along;
  }
  if (plan && !is_off) {
    if (auto straight = brake_straight(*plan, limits)) return *straight;
  }
  if (!measured) return {};
  const auto straight = brake_straight(measured->state, limits);
  return straight ? *straight : Trajectory{};
}

}  // namespace sidestep::ros1_executor
