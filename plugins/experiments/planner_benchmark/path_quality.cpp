#include "path_quality.hpp"

#include <cmath>
#include <vector>

namespace sidestep {
namespace {

constexpr int kSteps = 1000;

}  // namespace

double path_length(const Trajectory& trajectory) {
  double length = 0.0;
  for (int i = 1; i < trajectory.size(); ++i) {
    double squares = 0.0;
    for (std::size_t j = 0; j < trajectory.q(i).size(); ++j) {
      const double step = trajectory.q(i)[j] - trajectory.q(i - 1)[j];
      squares += step * step;
    }
    length += std::sqrt(squares);
  }
  return length;
}

double acceleration_ratio(const Trajectory& trajectory) {
  const double length = path_length(trajectory);
  if (!(length > 0.0)) return 0.0;
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  const double step_s = trajectory.duration_s() / kSteps;
  std::vector<double> q(dof), before(dof), now(dof);
  trajectory.sample(0.0, q, before);
  double integral = 0.0;
  for (int step = 1; step <= kSteps; ++step) {
    trajectory.sample(step_s * step, q, now);
    for (std::size_t j = 0; j < dof; ++j) {
      integral += (now[j] - before[j]) * (now[j] - before[j]) / step_s;
    }
    before.swap(now);
  }
  const double duration_s = trajectory.duration_s();
  return integral * duration_s * duration_s * duration_s / (12.0 * length * length);
}

}  // namespace sidestep
