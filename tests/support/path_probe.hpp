#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep::testing_support {

/// Positions of a trajectory at equal times, row by row.
inline std::vector<std::vector<double>> sampled(const Trajectory& trajectory, int steps) {
  std::vector<std::vector<double>> rows(
      static_cast<std::size_t>(steps) + 1,
      std::vector<double>(static_cast<std::size_t>(trajectory.dof)));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    trajectory.sample(trajectory.duration_s() * static_cast<double>(i) / steps, rows[i], {});
  }
  return rows;
}

/// How much of the limits a motion uses, from differences of densely sampled positions alone: the
/// largest of any joint's speed and acceleration, relative to their limits, at every sample.
inline std::vector<double> limit_use(const Trajectory& trajectory, const MotionLimits& limits,
                                     int steps) {
  const auto rows = sampled(trajectory, steps);
  const double h = trajectory.duration_s() / steps;
  std::vector<double> use;
  for (std::size_t i = 1; i + 1 < rows.size(); ++i) {
    double most = 0.0;
    for (std::size_t j = 0; j < rows[i].size(); ++j) {
      const double before = (rows[i][j] - rows[i - 1][j]) / h;
      const double after = (rows[i + 1][j] - rows[i][j]) / h;
      most = std::max({most, std::abs(before) / limits.velocity[j],
                       std::abs(after) / limits.velocity[j],
                       std::abs(after - before) / h / limits.acceleration[j]});
    }
    use.push_back(most);
  }
  return use;
}

inline double distance_to_segment(const std::vector<double>& p, const std::vector<double>& a,
                                  const std::vector<double>& b) {
  double along = 0.0, length = 0.0;
  for (std::size_t j = 0; j < p.size(); ++j) {
    along += (p[j] - a[j]) * (b[j] - a[j]);
    length += (b[j] - a[j]) * (b[j] - a[j]);
  }
  const double f = length > 0.0 ? std::clamp(along / length, 0.0, 1.0) : 0.0;
  double sum = 0.0;
  for (std::size_t j = 0; j < p.size(); ++j) {
    const double off = p[j] - a[j] - f * (b[j] - a[j]);
    sum += off * off;
  }
  return std::sqrt(sum);
}

/// How far `motion` strays from the path of `path` when both are walked from start to end in the
/// same order: the discrete Frechet way, greedy, with `path` as a polyline of `steps` segments.
inline double stray(const Trajectory& motion, const Trajectory& path, int steps) {
  const auto points = sampled(motion, steps / 4);
  const auto line = sampled(path, steps);
  double worst = 0.0;
  std::size_t at = 0;
  for (const auto& point : points) {
    double best = distance_to_segment(point, line[at], line[at + 1]);
    const std::size_t window = std::min(at + line.size() / 20, line.size() - 2);
    for (std::size_t k = at; k <= window; ++k) {
      const double distance = distance_to_segment(point, line[k], line[k + 1]);
      if (distance < best) {
        best = distance;
        at = k;
      }
    }
    worst = std::max(worst, best);
  }
  // All of the path has been walked, to its end.
  for (std::size_t j = 0; j < line.back().size(); ++j) {
    worst = std::max(worst, std::abs(points.back()[j] - line.back()[j]));
    worst = std::max(worst, std::abs(line[at + 1][j] - line.back()[j]));
  }
  return worst;
}

/// Where the first joint starts, turns back and ends.
inline std::vector<double> turning_points(const Trajectory& trajectory, int steps) {
  const auto rows = sampled(trajectory, steps);
  std::vector<double> points{rows.front()[0]};
  for (std::size_t i = 1; i + 1 < rows.size(); ++i) {
    // Not what rounding makes of a standstill.
    constexpr double kTurn = 1e-12;
    const double before = rows[i][0] - rows[i - 1][0], after = rows[i + 1][0] - rows[i][0];
    if (before * after < 0.0 && std::abs(before - after) > kTurn) points.push_back(rows[i][0]);
  }
  points.push_back(rows.back()[0]);
  return points;
}

}  // namespace sidestep::testing_support
