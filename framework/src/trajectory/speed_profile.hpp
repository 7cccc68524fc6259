#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <sidestep/core/lanes.hpp>
#include <sidestep/trajectory/motion_limits.hpp>

#include "path_stages.hpp"

namespace sidestep::detail {

/// Where and why a path cannot be followed.
struct Obstruction {
  int stage = 0;
  bool at_goal = false;  ///< The goal's velocity is the trouble, else the start's.
};

/// The fastest x = (dl/dt)^2 along a path of arc length l under limits: at each stage u = d2l/dt2
/// is constant, so that x changes by 2 u length, and at both of its ends
///
///     |dq/dl| sqrt(x) <= velocity     |dq/dl u + d2q/dl2 x| <= acceleration
///
/// for every joint (Pham and Pham 2018, with constraints at both ends of a stage).
class SpeedProfile {
 public:
  /// Shares of the limits that each stage may use, (0, 1].
  struct Shares {
    std::vector<double> velocity;
    std::vector<double> acceleration;
  };

  /// `limits` hold infinity for joints that never move.
  SpeedProfile(const PathStages& stages, const MotionLimits& limits)
      : stages_(stages), limits_(limits) {}

  /// Finds x at the ends of all stages from `x_start` to `x_goal`; false where there is none, and
  /// obstruction() says why.
  [[nodiscard]] bool solve(double x_start, double x_goal, const Shares& shares);

  struct Rest {
    int stage = 0;
    double share = 0.0;  ///< Of the stage's length.
  };
  /// Where the path stands still when it is braked hardest from `x_start`, with so much of the
  /// acceleration limits; nothing where it ends before, or cannot be braked so within them.
  [[nodiscard]] std::optional<Rest> braking_end(double x_start, double acceleration_share);

  /// One value more than there are stages.
  [[nodiscard]] const std::vector<double>& x() const noexcept { return x_; }
  [[nodiscard]] const Obstruction& obstruction() const noexcept { return obstruction_; }

 private:
  /// offset + slope x.
  struct Line {
    double offset = 0.0;
    double slope = 0.0;
    [[nodiscard]] double operator()(double x) const noexcept { return offset + slope * x; }
  };
  struct Bounds {
    Line lower, upper;  ///< Of u: the ones that bind at an x.
  };
  struct Interval {
    double low = 0.0;
    double high = 0.0;
  };

  void load_limits();
  void load_strips();
  void load(int stage, double acceleration_share);
  [[nodiscard]] Bounds bounds(double x) const noexcept;
  /// The values of x from which some u leads into [next_low_, next_high_].
  [[nodiscard]] std::optional<Interval> controllable(double x_max) const noexcept;
  void limit_speeds(const Shares& shares);
  [[nodiscard]] bool pass_backward(double x_goal, const Shares& shares);
  void pass_forward(double x_start, const Shares& shares);
  [[nodiscard]] int where_braking_fails(double x_start, const Shares& shares);

  const PathStages& stages_;
  const MotionLimits& limits_;
  std::vector<double> fastest_;  ///< Per node: x that the velocity limits allow.
  std::vector<Interval> reach_;  ///< Per node: x from which the goal can be reached.
  std::vector<double> x_;
  Obstruction obstruction_;

  std::size_t width_ = 0;          ///< Of a row: the joints in whole lanes.
  AlignedArray rows_;              ///< Of joints, in whole lanes: two of limits.
  AlignedArray strips_;            ///< Stages x four such rows.
  std::vector<double> most_x_of_;  ///< Per stage: what joints that do not feel u allow.
  std::int64_t version_ = 0;       ///< Of the stages that these are of.

  // Of the stage that is loaded.
  const double* widths_ = nullptr;  ///< And its slopes.
  double share_ = 0.0;              ///< Of the acceleration limits.
  double most_x_ = 0.0;             ///< What joints that do not feel u allow.
  double twice_length_ = 0.0;
  Interval next_;
};

}  // namespace sidestep::detail
