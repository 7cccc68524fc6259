#include <sidestep/runtime/localised_executor.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kMoved_m = 0.002;
constexpr double kMoved_rad = 0.002;
/// Beyond this a robot that is not corrected is not where it was shown to be clear.
constexpr double kBeside_m = 0.02;
constexpr double kBeside_rad = 0.02;

}  // namespace

Result<Executor::Measured> LocalisedExecutor::current() {
  auto measured = SIDESTEP_TRY(believed());
  if (!lost_.empty()) return fail(ErrorCode::kIo, lost_);
  SIDESTEP_TRY(correct(measured.stamp));
  return measured;
}

Result<Executor::Measured> LocalisedExecutor::believed() {
  auto measured = SIDESTEP_TRY(executor_.current());
  if (auto localisation = slot_.snapshot().localisation) {
    // Yaw goes on beyond half a turn, as odometry's does.
    const double turned_rad = yaw_of(localisation->T_map_odom) - yaw_of(T_map_odom_);
    if (std::abs(turned_rad) > std::numbers::pi) {
      turns_rad_ -= std::copysign(2.0 * std::numbers::pi, turned_rad);
    }
    T_map_odom_ = localisation->T_map_odom;
    lost_ = std::move(localisation->lost);
  }
  // Whoever owns the loop refuses a state of too few joints.
  const int joints = 1 + std::max({base_.x(), base_.y(), base_.yaw()});
  if (measured.state.q.size() >= joints) {
    base_.move(T_map_odom_, as_span(measured.state.q));
    measured.state.q[base_.yaw()] += turns_rad_;
  }
  if (measured.state.qdot.size() >= joints) base_.turn(T_map_odom_, as_span(measured.state.qdot));
  return measured;
}

Result<void> LocalisedExecutor::correct(Stamp now) {
  if (!followed_ || is_stopped_) return {};
  const double along_s = static_cast<double>(now.ns - followed_->start.ns) * 1e-9;
  if (along_s >= followed_->trajectory.duration_s()) return {};
  const Transform moved = T_map_odom_ * followed_->T_map_odom.inverse();
  // By how much that moves the robot, not the frame's origin.
  std::vector<double> q(idx(followed_->trajectory.dof));
  followed_->trajectory.sample(along_s, q, {});
  const Eigen::Vector3d p(q[idx(base_.x())], q[idx(base_.y())], 0.0);
  const double moved_m = (moved * p - p).norm();
  const double moved_rad = std::abs(yaw_of(moved));
  if (moved_m < kMoved_m && moved_rad < kMoved_rad) return {};
  const auto sent = send(followed_->trajectory, followed_->start);
  if (sent) followed_->T_map_odom = T_map_odom_;
  if (is_stopped_) (void)executor_.stop();  // which came meanwhile
  if (sent || (moved_m < kBeside_m && moved_rad < kBeside_rad)) return {};
  return fail(ErrorCode::kIo,
              format("the robot is %.3f m", moved_m) +
                  format(" and %.3f rad beside what it follows", moved_rad) +
                  ", and its executor does not take the correction: " + sent.error().describe());
}

Result<void> LocalisedExecutor::send(const Trajectory& trajectory, Stamp start) {
  Trajectory by_odometry = trajectory;
  const Transform T_odom_map = T_map_odom_.inverse();
  for (int i = 0; i < by_odometry.size(); ++i) {
    base_.move(T_odom_map, by_odometry.q(i));
    base_.turn(T_odom_map, by_odometry.qdot(i));
    by_odometry.q(i)[idx(base_.yaw())] -= turns_rad_;
  }
  return executor_.follow(by_odometry, start);
}

Result<void> LocalisedExecutor::follow(const Trajectory& trajectory, Stamp start) {
  if (is_stopped_.exchange(false)) followed_.reset();  // a stop that comes from here on counts
  SIDESTEP_TRY(send(trajectory, start));
  followed_ = {trajectory, start, T_map_odom_};
  return {};
}

Result<void> LocalisedExecutor::stop() {
  is_stopped_ = true;
  return executor_.stop();
}

}  // namespace sidestep
