#include "chord_check.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep {
namespace {

/// Pieces farther than this from a chord begin another: long chords first, and where they cannot
/// be shown clear, shorter ones.
constexpr double kBeside_m[] = {2e-3, 5e-4};

/// Calls with the control points of the piece after a state, less the first: three in a row.
template <class Call>
void for_control_points(const Trajectory& trajectory, int state, Call&& call) {
  const auto at = static_cast<std::size_t>(state);
  const double third_s = (trajectory.times_s[at + 1] - trajectory.times_s[at]) / 3.0;
  const auto q0 = trajectory.q(state), q1 = trajectory.q(state + 1);
  const auto v0 = trajectory.qdot(state), v1 = trajectory.qdot(state + 1);
  call([=](std::size_t j) { return q0[j] + third_s * v0[j]; });
  call([=](std::size_t j) { return q1[j] - third_s * v1[j]; });
  call([=](std::size_t j) { return q1[j]; });
}

/// How far a configuration is from the line through `from` towards `to`, or from what lies between
/// the two, as motion of spheres.
template <class Point>
double off_line_m(std::span<const double> from, std::span<const double> to, bool is_ray,
                  std::span<const double> levers, const Point& point) {
  double along = 0.0, square = 0.0;
  for (std::size_t j = 0; j < levers.size(); ++j) {
    const double step = to[j] - from[j];
    along += step * (point(j) - from[j]);
    square += step * step;
  }
  double share = square > 0.0 ? std::max(0.0, along / square) : 0.0;
  if (!is_ray) share = std::min(1.0, share);
  double sum_m = 0.0;
  for (std::size_t j = 0; j < levers.size(); ++j) {
    const double off = std::abs(point(j) - (from[j] + share * (to[j] - from[j])));
    if (off > 0.0) sum_m += levers[j] * off;
  }
  return sum_m;
}

}  // namespace

ChordCheck::ChordCheck(std::shared_ptr<const RobotModel> robot,
                       std::shared_ptr<const MotionBounds> bounds, std::span<const double> levers,
                       std::shared_ptr<const SceneField> field, const SpacePolicy& space,
                       double margin_m)
    : levers_(levers.begin(), levers.end()), prover_(std::move(robot), std::move(bounds)) {
  prover_.look_at(std::move(field), space, margin_m);
}

bool ChordCheck::shows_clear(const Trajectory& trajectory, int from_state, double resolution_m,
                             const Deadline& deadline) const {
  const std::scoped_lock lock(mutex_);
  for (int first = from_state; first + 1 < trajectory.size();) {
    if (deadline.expired()) return false;
    int last = first;
    for (const double most_m : kBeside_m) {
      const int end = chord_end(trajectory, first, most_m);
      const double beside = beside_m(trajectory, first, end);
      if (!(beside < 2.0 * most_m)) continue;
      if (!prover_.is_clear(trajectory.q(first), trajectory.q(end), resolution_m, beside)) continue;
      last = end;
      break;
    }
    if (last == first) return false;
    first = last;
  }
  return true;
}

int ChordCheck::chord_end(const Trajectory& trajectory, int first, double most_m) const {
  // The direction is that of the first piece that leads anywhere.
  int ahead = first + 1;
  while (ahead + 1 < trajectory.size() &&
         std::ranges::equal(trajectory.q(first), trajectory.q(ahead))) {
    ++ahead;
  }
  int last = first + 1;
  for (; last + 1 < trajectory.size(); ++last) {
    bool is_near = true;
    for_control_points(trajectory, last, [&](const auto& point) {
      is_near = is_near &&
                off_line_m(trajectory.q(first), trajectory.q(ahead), true, levers_, point) < most_m;
    });
    if (!is_near) break;
  }
  return last;
}

double ChordCheck::beside_m(const Trajectory& trajectory, int first, int last) const {
  double most_m = 0.0;
  for (int state = first; state < last; ++state) {
    for_control_points(trajectory, state, [&](const auto& point) {
      most_m = std::max(most_m,
                        off_line_m(trajectory.q(first), trajectory.q(last), false, levers_, point));
    });
  }
  return most_m;
}

}  // namespace sidestep
