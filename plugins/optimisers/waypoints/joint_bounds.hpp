#pragma once

#include <sidestep/planning/problem.hpp>

#include "difference_metric.hpp"

namespace sidestep {

/// The positions that waypoints may have: the joints' limits, narrowed by `margin` on both sides
/// (m, rad; no more than leaves start, goal and half the range free).
struct JointBounds {
  Eigen::VectorXd lower, upper;

  JointBounds(const Problem& problem, double margin);

  [[nodiscard]] bool contain(const Waypoints& positions) const;
};

/// Brings the inner waypoints within bounds as smoothly as the metric allows (Zucker 2013, section
/// 3.4): adds A^-1 v, v the violations of a joint, scaled to take back the largest of them, until
/// there are none. What is left of them after as many rounds as there are waypoints is cut off.
void keep_within(const JointBounds& bounds, const DifferenceMetric& metric, Waypoints& positions);

}  // namespace sidestep
