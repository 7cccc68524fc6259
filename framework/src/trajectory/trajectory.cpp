#include <sidestep/trajectory/trajectory.hpp>

#include <algorithm>
#include <cmath>
#include <string>

#include "hermite.hpp"

namespace sidestep {
namespace {

void copy_state(const Trajectory& from, int state, std::span<double> q_out,
                std::span<double> qdot_out) noexcept {
  std::ranges::copy(from.q(state), q_out.begin());
  if (!qdot_out.empty()) std::ranges::copy(from.qdot(state), qdot_out.begin());
}

std::string state_and_joint(std::size_t index, int dof) {
  return "state " + std::to_string(index / static_cast<std::size_t>(dof)) + ", joint " +
         std::to_string(index % static_cast<std::size_t>(dof));
}

Result<void> require_finite(const std::vector<double>& values, int dof, std::string_view what) {
  const auto bad = std::ranges::find_if_not(values, [](double v) { return std::isfinite(v); });
  if (bad == values.end()) return {};
  const auto index = static_cast<std::size_t>(bad - values.begin());
  return invalid("the trajectory's " + std::string(what) + " at " + state_and_joint(index, dof) +
                 " is not a finite number");
}

}  // namespace

void Trajectory::sample(double time_s, std::span<double> q_out,
                        std::span<double> qdot_out) const noexcept {
  if (times_s.empty()) return;
  if (!(time_s > times_s.front())) return copy_state(*this, 0, q_out, qdot_out);
  if (time_s >= times_s.back()) return copy_state(*this, size() - 1, q_out, qdot_out);

  const auto after = std::upper_bound(times_s.begin(), times_s.end(), time_s);
  const int i = static_cast<int>(after - times_s.begin()) - 1;
  const double dt = *after - *(after - 1);
  const auto basis = detail::hermite_basis(dt, (time_s - *(after - 1)) / dt);
  const auto q0 = q(i), q1 = q(i + 1), v0 = qdot(i), v1 = qdot(i + 1);
  for (std::size_t j = 0; j < q_out.size(); ++j) {
    q_out[j] = q0[j] + basis.rise * (q1[j] - q0[j]) + basis.out * v0[j] + basis.in * v1[j];
  }
  for (std::size_t j = 0; j < qdot_out.size(); ++j) {
    qdot_out[j] =
        basis.rise_rate * (q1[j] - q0[j]) + basis.out_rate * v0[j] + basis.in_rate * v1[j];
  }
}

Result<void> Trajectory::validate() const {
  if (dof <= 0) return invalid("the trajectory has no joints");
  if (times_s.empty()) return invalid("the trajectory has no states");
  const std::size_t values = times_s.size() * static_cast<std::size_t>(dof);
  if (positions.size() != values || velocities.size() != values) {
    return invalid("a trajectory of " + std::to_string(times_s.size()) + " states of " +
                   std::to_string(dof) + " joints needs " + std::to_string(values) +
                   " positions and velocities, not " + std::to_string(positions.size()) + " and " +
                   std::to_string(velocities.size()));
  }
  if (times_s.front() != 0.0) {
    return invalid("the trajectory's first time is not 0");
  }
  for (std::size_t i = 1; i < times_s.size(); ++i) {
    if (!(times_s[i] > times_s[i - 1]) || !std::isfinite(times_s[i])) {
      return invalid("the trajectory's times do not increase at state " + std::to_string(i));
    }
  }
  SIDESTEP_TRY(require_finite(positions, dof, "position"));
  return require_finite(velocities, dof, "velocity");
}

Trajectory make_trajectory(int dof, int states, double dt_s) {
  Trajectory out;
  out.dof = dof;
  out.times_s.resize(static_cast<std::size_t>(states));
  for (int i = 0; i < states; ++i) out.times_s[static_cast<std::size_t>(i)] = i * dt_s;
  out.positions.assign(out.times_s.size() * static_cast<std::size_t>(dof), 0.0);
  out.velocities = out.positions;
  return out;
}

Trajectory straight_line(const RobotState& start, const RobotState& goal, int states, double dt_s) {
  const int dof = static_cast<int>(start.q.size());
  Trajectory out = make_trajectory(dof, states, dt_s);
  const int last = states - 1;
  for (int i = 0; i <= last; ++i) {
    const double fraction = static_cast<double>(i) / last;
    const auto q = out.q(i);
    const auto qdot = out.qdot(i);
    for (int j = 0; j < dof; ++j) {
      const double distance = goal.q[j] - start.q[j];
      const auto at = static_cast<std::size_t>(j);
      q[at] = i == last ? goal.q[j] : start.q[j] + fraction * distance;
      qdot[at] = i == 0 ? start.qdot[j] : i == last ? goal.qdot[j] : distance / (last * dt_s);
    }
  }
  return out;
}

Trajectory refit(const Trajectory& previous, double from_s, int states, double dt_s) {
  Trajectory out = make_trajectory(previous.dof, states, dt_s);
  const double from = std::clamp(from_s, 0.0, previous.duration_s());
  const double remaining_s = previous.duration_s() - from;
  const int last = states - 1;
  const double stretch = last * dt_s / remaining_s;  // infinite once the end is reached
  for (int i = 0; i <= last; ++i) {
    const double time_s =
        i == last ? previous.duration_s() : from + remaining_s * (static_cast<double>(i) / last);
    previous.sample(time_s, out.q(i), out.qdot(i));
    for (double& velocity : out.qdot(i)) velocity /= stretch;
  }
  return out;
}

}  // namespace sidestep
