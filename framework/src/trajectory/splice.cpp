#include <sidestep/trajectory/splice.hpp>

#include <algorithm>

namespace sidestep {
namespace {

/// States nearer to an end of a cut than this are left out: what lies between them is rounding.
constexpr double kSameTime_s = 1e-6;

void append(Trajectory& out, double time_s, std::span<const double> q,
            std::span<const double> qdot) {
  out.times_s.push_back(time_s);
  out.positions.insert(out.positions.end(), q.begin(), q.end());
  out.velocities.insert(out.velocities.end(), qdot.begin(), qdot.end());
}

}  // namespace

Trajectory cut(const Trajectory& trajectory, double from_s, double to_s) {
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  const double end_s = trajectory.duration_s();
  const double from = std::clamp(from_s, 0.0, end_s);
  const double to = std::min(std::max(to_s, from + 2.0 * kSameTime_s), end_s);
  Trajectory out;
  out.dof = trajectory.dof;
  std::vector<double> q(dof), qdot(dof);
  const auto append_sample = [&](double time_s) {
    trajectory.sample(time_s, q, qdot);
    append(out, time_s - from, q, qdot);
  };
  const bool has_motion = to - from > kSameTime_s;
  const bool waits = to_s - end_s > kSameTime_s;
  if (has_motion) append_sample(from);
  for (int i = 0; i < trajectory.size(); ++i) {
    const double time_s = trajectory.times_s[static_cast<std::size_t>(i)];
    if (time_s <= from + kSameTime_s || time_s >= to - kSameTime_s) continue;
    append(out, time_s - from, trajectory.q(i), trajectory.qdot(i));
  }
  if (has_motion && !waits) {
    append_sample(to);
    return out;
  }
  const int last = trajectory.size() - 1;
  const std::vector<double> rest(dof, 0.0);
  append(out, has_motion ? to - from : 0.0, trajectory.q(last), rest);
  append(out, std::max(to_s - from, out.times_s.back() + kSameTime_s), trajectory.q(last), rest);
  return out;
}

Trajectory joined(const Trajectory& first, const Trajectory& second) {
  Trajectory out = first;
  const double begin_s = first.duration_s();
  for (int i = 1; i < second.size(); ++i) {
    append(out, begin_s + second.times_s[static_cast<std::size_t>(i)], second.q(i), second.qdot(i));
  }
  return out;
}

Trajectory resting(std::span<const double> q, double duration_s) {
  Trajectory out = make_trajectory(static_cast<int>(q.size()), 2, duration_s);
  std::ranges::copy(q, out.q(0).begin());
  std::ranges::copy(q, out.q(1).begin());
  return out;
}

}  // namespace sidestep
