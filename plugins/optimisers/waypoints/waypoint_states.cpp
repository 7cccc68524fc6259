#include "waypoint_states.hpp"

#include <algorithm>
#include <array>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

std::span<const double> values(const Eigen::MatrixXd& matrix, int first, int count) {
  return {matrix.data() + matrix.rows() * first, idx(count) * idx(int(matrix.rows()))};
}

}  // namespace

WaypointStates::WaypointStates(const Problem& problem)
    : dof_(problem.robot->description().dof()),
      checks_(problem.interpolated_checks),
      waypoints_(problem.support_states),
      dt_s_(problem.dt_s),
      start_(problem.start),
      goal_(problem.goal) {
  for (int k = 1; k <= checks_; ++k) {
    const double s = k / (checks_ + 1.0);
    const double away = 1.0 - s;
    between_.push_back({{away * away * (1.0 + 2.0 * s), s * away * away * dt_s_,
                         s * s * (3.0 - 2.0 * s), -s * s * away * dt_s_},
                        {-6.0 * s * away / dt_s_, away * (1.0 - 3.0 * s), 6.0 * s * away / dt_s_,
                         s * (3.0 * s - 2.0)}});
  }
  support_q_.setZero(dof_, waypoints_);
  support_qdot_.setZero(dof_, waypoints_);
  all_q_.setZero(dof_, states());
  all_qdot_.setZero(dof_, states());
  for (int i = 0; i < waypoints_; ++i) support_times_s_.push_back(i * dt_s_);
  for (int s = 0; s < states(); ++s) all_times_s_.push_back(s * dt_s_ / step());
  find_shares();
}

/// By what update() does, with one joint and a unit at one waypoint after the other.
void WaypointStates::find_shares() {
  const int last = waypoints_ - 1;
  for (int s = 0; s < states(); ++s) {
    first_share_.push_back(shares_.size());
    const int i = std::min(s / step(), last);
    const int k = s % step();
    for (int w = std::max(0, i - 1); w <= std::min(last, i + (k == 0 ? 1 : 2)); ++w) {
      const auto velocity = [&](int at) {
        if (at == 0 || at == last) return 0.0;
        return (w == at + 1 ? 0.5 : w == at - 1 ? -0.5 : 0.0) / dt_s_;
      };
      Share share{w, w == i ? 1.0 : 0.0, velocity(i)};
      if (k > 0) {
        const auto& [q, qdot] = between_[idx(k - 1)];
        const std::array ends{w == i ? 1.0 : 0.0, velocity(i), w == i + 1 ? 1.0 : 0.0,
                              velocity(i + 1)};
        share.of_q = q[0] * ends[0] + q[1] * ends[1] + q[2] * ends[2] + q[3] * ends[3];
        share.of_qdot =
            qdot[0] * ends[0] + qdot[1] * ends[1] + qdot[2] * ends[2] + qdot[3] * ends[3];
      }
      if (share.of_q != 0.0 || share.of_qdot != 0.0) shares_.push_back(share);
    }
  }
  first_share_.push_back(shares_.size());
}

std::span<const WaypointStates::Share> WaypointStates::shares(int state) const noexcept {
  const std::size_t first = first_share_[idx(state)];
  return std::span(shares_).subspan(first, first_share_[idx(state) + 1] - first);
}

Waypoints WaypointStates::positions_of(const Trajectory& trajectory) const {
  Waypoints positions = Eigen::Map<const Waypoints>(trajectory.positions.data(), dof_, waypoints_);
  positions.col(0) = start_.q;
  positions.col(waypoints_ - 1) = goal_.q;
  return positions;
}

void WaypointStates::update(const Waypoints& positions) {
  support_q_ = positions;
  const int inner = waypoints_ - 2;
  support_qdot_.middleCols(1, inner) =
      (positions.rightCols(inner) - positions.leftCols(inner)) * (0.5 / dt_s_);
  support_qdot_.col(0) = start_.qdot;
  support_qdot_.col(waypoints_ - 1) = goal_.qdot;
  for (int i = 0; i < waypoints_; ++i) {
    all_q_.col(i * step()) = support_q_.col(i);
    all_qdot_.col(i * step()) = support_qdot_.col(i);
    if (i + 1 == waypoints_) break;
    for (int k = 1; k <= checks_; ++k) {
      const auto& [q, qdot] = between_[idx(k - 1)];
      all_q_.col(i * step() + k) = q[0] * support_q_.col(i) + q[1] * support_qdot_.col(i) +
                                   q[2] * support_q_.col(i + 1) + q[3] * support_qdot_.col(i + 1);
      all_qdot_.col(i * step() + k) = qdot[0] * support_q_.col(i) + qdot[1] * support_qdot_.col(i) +
                                      qdot[2] * support_q_.col(i + 1) +
                                      qdot[3] * support_qdot_.col(i + 1);
    }
  }
}

StateBatch WaypointStates::at_waypoints() const noexcept {
  return {waypoints_, dof_, values(support_q_, 0, waypoints_), values(support_qdot_, 0, waypoints_),
          support_times_s_};
}

StateBatch WaypointStates::everywhere() const noexcept {
  return {states(), dof_, values(all_q_, 0, states()), values(all_qdot_, 0, states()),
          all_times_s_};
}

StateBatch WaypointStates::at_waypoint(int i) const noexcept {
  return {1, dof_, values(support_q_, i, 1), values(support_qdot_, i, 1),
          std::span(support_times_s_).subspan(idx(i), 1)};
}

void WaypointStates::pull_back(const Eigen::MatrixXd& by_q, const Eigen::MatrixXd& by_qdot,
                               Waypoints& by_waypoint) const {
  for (int s = 0; s < states(); ++s) {
    for (const Share& share : shares(s)) {
      by_waypoint.col(share.waypoint) += share.of_q * by_q.col(s) + share.of_qdot * by_qdot.col(s);
    }
  }
}

Trajectory WaypointStates::trajectory() const {
  Trajectory out = make_trajectory(dof_, waypoints_, dt_s_);
  std::ranges::copy(at_waypoints().q, out.positions.begin());
  std::ranges::copy(at_waypoints().qdot, out.velocities.begin());
  return out;
}

}  // namespace sidestep
