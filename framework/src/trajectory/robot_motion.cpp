#include <sidestep/trajectory/robot_motion.hpp>

#include <algorithm>
#include <span>
#include <utility>

#include "hermite.hpp"

namespace sidestep {
namespace {

std::span<double> values(Eigen::VectorXd& vector) {
  return {vector.data(), static_cast<std::size_t>(vector.size())};
}

}  // namespace

void RobotMotion::add(History& history, const RobotState& state, Stamp stamp) const {
  if (!history.empty() &&
      (stamp <= history.back().stamp || state.q.size() != history.back().state.q.size())) {
    return;
  }
  history.push_back({stamp, state});
  RobotState& added = history.back().state;
  if (added.qdot.size() != added.q.size()) added.qdot.setZero(added.q.size());
  // One sample before what is kept stays, so that its whole span can be interpolated.
  const std::int64_t oldest_ns = stamp.ns - Stamp::from_seconds(history_s_).ns;
  while (history.size() > 1 && history[1].stamp.ns <= oldest_ns) history.pop_front();
}

std::optional<RobotState> RobotMotion::at(const History& history, Stamp stamp) {
  const auto after = std::ranges::lower_bound(history, stamp, {}, &Sample::stamp);
  if (after == history.end()) return {};
  if (after->stamp == stamp) return after->state;
  if (after == history.begin()) return {};
  const auto before = std::prev(after);
  const double dt_s = static_cast<double>(after->stamp.ns - before->stamp.ns) * 1e-9;
  const double in_s = static_cast<double>(stamp.ns - before->stamp.ns) * 1e-9;
  const auto basis = detail::hermite_basis(dt_s, in_s / dt_s);
  const RobotState& a = before->state;
  const RobotState& b = after->state;
  return RobotState{
      a.q + basis.rise * (b.q - a.q) + basis.out * a.qdot + basis.in * b.qdot,
      basis.rise_rate * (b.q - a.q) + basis.out_rate * a.qdot + basis.in_rate * b.qdot};
}

void RobotMotion::record(const RobotState& state, Stamp stamp) {
  const std::lock_guard lock(mutex_);
  add(measured_, state, stamp);
}

void RobotMotion::record_truth(const RobotState& state, Stamp stamp) {
  const std::lock_guard lock(mutex_);
  add(true_, state, stamp);
}

void RobotMotion::follow(Trajectory trajectory, Stamp start) {
  const std::lock_guard lock(mutex_);
  followed_ = std::move(trajectory);
  start_ = start;
}

std::optional<RobotState> RobotMotion::measured(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  return at(measured_, stamp);
}

std::optional<Stamp> RobotMotion::newest() const {
  const std::lock_guard lock(mutex_);
  if (measured_.empty()) return {};
  return measured_.back().stamp;
}

std::optional<RobotState> RobotMotion::truth(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  return at(true_.empty() ? measured_ : true_, stamp);
}

std::optional<RobotState> RobotMotion::planned(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  if (followed_.size() == 0) return {};
  const double time_s = static_cast<double>(stamp.ns - start_.ns) * 1e-9;
  RobotState state{Eigen::VectorXd(followed_.dof), Eigen::VectorXd(followed_.dof)};
  followed_.sample(time_s, values(state.q), values(state.qdot));
  if (time_s < 0.0 || time_s > followed_.duration_s()) state.qdot.setZero();
  return state;
}

}  // namespace sidestep
