#pragma once

#include <array>

#include <Eigen/Core>

namespace sidestep::detail {

/// Where a base is, and how fast.
struct BaseState {
  Eigen::Vector2d p_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d v_mps = Eigen::Vector2d::Zero();
};

/// A stretch of motion in which the velocity changes evenly.
struct Stretch {
  double duration_s = 0.0;
  BaseState end;
};

/// What a base may do in whatever direction.
struct BaseLimits {
  double speed_mps = 0.0;
  double acceleration_mps2 = 0.0;
};

/// From one state straight to the goal: to rest where need be, onto the line, along it, and to
/// rest.
struct Closing {
  std::array<Stretch, 4> stretches;
  double duration_s = 0.0;
};

/// The fastest such way; where there is none without, to rest first.
[[nodiscard]] Closing close(const BaseState& from, const Eigen::Vector2d& goal_m,
                            const BaseLimits& limits);

/// No motion from that state is at rest at the goal sooner: along the line to the goal and across
/// it, each by itself.
[[nodiscard]] double least_duration_s(const BaseState& from, const Eigen::Vector2d& goal_m,
                                      const BaseLimits& limits) noexcept;

/// The place `t` after the begin of a stretch.
[[nodiscard]] Eigen::Vector2d place_on(const BaseState& from, const Stretch& stretch,
                                       double t) noexcept;

}  // namespace sidestep::detail
