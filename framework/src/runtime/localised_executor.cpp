#include <sidestep/runtime/localised_executor.hpp>

#include <algorithm>
#include <cmath>
#include <vector>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kMoved_m = 0.002;
constexpr double kMoved_rad = 0.002;

}  // namespace

Result<Executor::Measured> LocalisedExecutor::current() {
  auto measured = SIDESTEP_TRY(executor_.current());
  if (const auto localisation = slot_.snapshot().localisation) {
    if (!localisation->lost.empty()) return fail(ErrorCode::kIo, localisation->lost);
    T_map_odom_ = localisation->T_map_odom;
    correct(measured.stamp);
  }
  // Whoever owns the loop refuses a state of too few joints.
  const int joints = 1 + std::max({base_.x(), base_.y(), base_.yaw()});
  if (measured.state.q.size() >= joints) base_.move(T_map_odom_, as_span(measured.state.q));
  if (measured.state.qdot.size() >= joints) base_.turn(T_map_odom_, as_span(measured.state.qdot));
  return measured;
}

void LocalisedExecutor::correct(Stamp now) {
  if (!followed_ || is_stopped_) return;
  const Transform moved = T_map_odom_ * followed_->T_map_odom.inverse();
  // By how much that moves the robot, not the frame's origin.
  const double along_s = static_cast<double>(now.ns - followed_->start.ns) * 1e-9;
  std::vector<double> q(idx(followed_->trajectory.dof));
  followed_->trajectory.sample(along_s, q, {});
  const Eigen::Vector3d p(q[idx(base_.x())], q[idx(base_.y())], 0.0);
  if ((moved * p - p).norm() < kMoved_m && std::abs(yaw_of(moved)) < kMoved_rad) return;
  // One that the executor refuses is as good as it was.
  (void)send(followed_->trajectory, followed_->start);
  followed_->T_map_odom = T_map_odom_;
  if (is_stopped_) (void)executor_.stop();  // which came meanwhile
}

Result<void> LocalisedExecutor::send(const Trajectory& trajectory, Stamp start) {
  Trajectory by_odometry = trajectory;
  const Transform T_odom_map = T_map_odom_.inverse();
  for (int i = 0; i < by_odometry.size(); ++i) {
    base_.move(T_odom_map, by_odometry.q(i));
    base_.turn(T_odom_map, by_odometry.qdot(i));
  }
  return executor_.follow(by_odometry, start);
}

Result<void> LocalisedExecutor::follow(const Trajectory& trajectory, Stamp start) {
  const bool was_stopped = is_stopped_.exchange(false);  // one that comes from here on counts
  auto sent = send(trajectory, start);
  if (!sent) {
    if (was_stopped) is_stopped_ = true;
    return sent;
  }
  followed_ = {trajectory, start, T_map_odom_};
  return {};
}

Result<void> LocalisedExecutor::stop() {
  is_stopped_ = true;
  return executor_.stop();
}

}  // namespace sidestep
