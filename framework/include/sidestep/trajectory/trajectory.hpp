#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Joint positions (m, rad) and velocities (m/s, rad/s) of one instant.
struct RobotState {
  Eigen::VectorXd q;
  Eigen::VectorXd qdot;
};

/// Support states over time. Between two of them the motion is the posterior mean of the
/// white-noise-on-acceleration prior, which is the cubic Hermite interpolant of the positions
/// and velocities (Barfoot 2014; GPMP2, IJRR 2018, eq. 19). Plain data, any thread.
struct Trajectory {
  int dof = 0;
  std::vector<double> times_s;     ///< Strictly increasing; n values, the first is 0.
  std::vector<double> positions;   ///< n x dof, row by row.
  std::vector<double> velocities;  ///< n x dof, per second.

  [[nodiscard]] int size() const noexcept { return static_cast<int>(times_s.size()); }
  [[nodiscard]] double duration_s() const noexcept {
    return times_s.empty() ? 0.0 : times_s.back();
  }

  [[nodiscard]] std::span<const double> q(int state) const noexcept {
    return std::span(positions).subspan(offset(state), static_cast<std::size_t>(dof));
  }
  [[nodiscard]] std::span<const double> qdot(int state) const noexcept {
    return std::span(velocities).subspan(offset(state), static_cast<std::size_t>(dof));
  }
  [[nodiscard]] std::span<double> q(int state) noexcept {
    return std::span(positions).subspan(offset(state), static_cast<std::size_t>(dof));
  }
  [[nodiscard]] std::span<double> qdot(int state) noexcept {
    return std::span(velocities).subspan(offset(state), static_cast<std::size_t>(dof));
  }

  /// Position and velocity at a time; held at the ends outside [0, duration]. `q_out` and
  /// `qdot_out` have dof values; `qdot_out` may be empty. Does not allocate.
  void sample(double time_s, std::span<double> q_out, std::span<double> qdot_out) const noexcept;

  /// Fails with kInvalidArgument where sizes disagree, times do not increase or a value is
  /// not finite, naming the state and the joint index.
  [[nodiscard]] Result<void> validate() const;

 private:
  [[nodiscard]] std::size_t offset(int state) const noexcept {
    return static_cast<std::size_t>(state) * static_cast<std::size_t>(dof);
  }
};

/// A trajectory of `states` >= 2 support states, dt_s apart, all zero.
[[nodiscard]] Trajectory make_trajectory(int dof, int states, double dt_s);

/// Constant velocity from start to goal, `states` >= 2, dt_s apart; the end states carry the
/// velocities of `start` and `goal`.
[[nodiscard]] Trajectory straight_line(const RobotState& start, const RobotState& goal, int states,
                                       double dt_s);

/// The previous trajectory from `from_s` on, resampled at `states` times dt_s apart after
/// stretching its remaining time to fit (Finean 2021, Alg. 1: refit).
[[nodiscard]] Trajectory refit(const Trajectory& previous, double from_s, int states, double dt_s);

struct Horizon {
  int states = 0;  ///< Support states, at least 3.
  double dt_s = 0.0;
};

/// Number of support states for a motion: the least time of a straight cubic motion from rest
/// to rest within every joint's limits (peak velocity 1.5 distance / T at `speed_fraction`,
/// (0..1], of its limit; peak acceleration 6 distance / T^2), in steps of dt_s, rounded up. At
/// most 10,000 states, whatever the numbers.
[[nodiscard]] Horizon estimate_horizon(const RobotDescription& robot,
                                       std::span<const double> q_start,
                                       std::span<const double> q_goal, double dt_s,
                                       double speed_fraction);

/// Times a path of configurations (n x dof, row by row) within the robot's velocity limits
/// scaled by `speed_fraction` and its acceleration limits where they are known. The path is
/// followed exactly: each straight stretch is one cubic Hermite piece from rest to rest, so the
/// robot stops at every vertex where the direction changes and only there. Fails with
/// kInvalidArgument, naming the joint, for a malformed path or a robot without velocity limits.
[[nodiscard]] Result<Trajectory> time_path(const RobotDescription& robot,
                                           std::span<const double> path, double speed_fraction);

}  // namespace sidestep
