#include <sidestep/trajectory/trajectory.hpp>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/gp_prior.hpp>
#include <sidestep/trajectory/robot_motion.hpp>
#include <sidestep/trajectory/splice.hpp>

namespace sidestep {
namespace {

/// The cubic Hermite basis on an interval of `dt_s` at `fraction` of it. With a = q_i,
/// b = q_{i+1}: position = a + rise * (b - a) + out * a' + in * b', and its time derivative
/// likewise with the rates. Written with b - a, a long way from zero loses no digits.
struct HermiteBasis {
  double rise, out, in;
  double rise_rate, out_rate, in_rate;
};

[[nodiscard]] HermiteBasis hermite_basis(double dt_s, double fraction) noexcept {
  const double f = fraction;
  const double g = 1.0 - fraction;
  return {.rise = f * f * (3.0 - 2.0 * f),
          .out = dt_s * f * g * g,
          .in = -dt_s * f * f * g,
          .rise_rate = 6.0 * f * g / dt_s,
          .out_rate = g * (1.0 - 3.0 * f),
          .in_rate = f * (3.0 * f - 2.0)};
}

void copy_state(const Trajectory& from, int state, std::span<double> q_out,
                std::span<double> qdot_out) noexcept {
  std::ranges::copy(from.q(state), q_out.begin());
  if (!qdot_out.empty()) std::ranges::copy(from.qdot(state), qdot_out.begin());
}

std::string state_and_joint(std::size_t index, int dof) {
  return "state " + std::to_string(index / idx(dof)) + ", joint " +
         std::to_string(index % idx(dof));
}

Result<void> require_finite(const std::vector<double>& values, int dof, std::string_view what) {
  const auto bad = std::ranges::find_if_not(values, [](double v) { return std::isfinite(v); });
  if (bad == values.end()) return {};
  const auto index = idx(bad - values.begin());
  return invalid("the trajectory's " + std::string(what) + " at " + state_and_joint(index, dof) +
                 " is not a finite number");
}

/// States nearer to an end of a cut than this are left out: what lies between them is rounding.
constexpr double kSameTime_s = 1e-6;

void append(Trajectory& out, double time_s, std::span<const double> q,
            std::span<const double> qdot) {
  out.times_s.push_back(time_s);
  out.positions.insert(out.positions.end(), q.begin(), q.end());
  out.velocities.insert(out.velocities.end(), qdot.begin(), qdot.end());
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
  const auto basis = hermite_basis(dt, (time_s - *(after - 1)) / dt);
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
  const std::size_t values = times_s.size() * idx(dof);
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
  out.times_s.resize(idx(states));
  for (int i = 0; i < states; ++i) out.times_s[idx(i)] = i * dt_s;
  out.positions.assign(out.times_s.size() * idx(dof), 0.0);
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
      const auto at = idx(j);
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

Trajectory cut(const Trajectory& trajectory, double from_s, double to_s) {
  const auto dof = idx(trajectory.dof);
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
    const double time_s = trajectory.times_s[idx(i)];
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
  const double until_s = to_s - std::max(from_s, from);
  append(out, std::max(until_s, out.times_s.back() + kSameTime_s), trajectory.q(last), rest);
  return out;
}

RobotState end_state(const Trajectory& trajectory) {
  const auto vector = [](std::span<const double> values) {
    return Eigen::VectorXd::Map(values.data(), std::ssize(values));
  };
  const int last = trajectory.size() - 1;
  return {vector(trajectory.q(last)), vector(trajectory.qdot(last))};
}

Trajectory joined(const Trajectory& first, const Trajectory& second) {
  Trajectory out = first;
  const double begin_s = first.duration_s();
  for (int i = 1; i < second.size(); ++i) {
    append(out, begin_s + second.times_s[idx(i)], second.q(i), second.qdot(i));
  }
  return out;
}

NearestState nearest_state(const Trajectory& trajectory, std::span<const double> q) {
  std::vector<double> there(q.size());
  const auto off_at = [&](double time_s) {
    trajectory.sample(time_s, there, {});
    double off = 0.0;
    for (std::size_t j = 0; j < q.size(); ++j) off = std::max(off, std::abs(there[j] - q[j]));
    return off;
  };
  int nearest = 0;
  NearestState found{trajectory.times_s.front(), off_at(trajectory.times_s.front())};
  for (int state = 1; state < trajectory.size(); ++state) {
    const double time_s = trajectory.times_s[idx(state)];
    if (const double off = off_at(time_s); off <= found.off) {
      nearest = state;
      found = {time_s, off};
    }
  }
  const double first_s = trajectory.times_s[idx(std::max(0, nearest - 1))];
  const double last_s = trajectory.times_s[idx(std::min(nearest + 1, trajectory.size() - 1))];
  double from_s = first_s, to_s = last_s;
  while (to_s - from_s > 1e-4 * (last_s - first_s)) {
    const double a_s = from_s + (to_s - from_s) / 3.0, b_s = to_s - (to_s - from_s) / 3.0;
    if (off_at(a_s) < off_at(b_s)) {
      to_s = b_s;
    } else {
      from_s = a_s;
    }
  }
  const double time_s = 0.5 * (from_s + to_s);
  if (const double off = off_at(time_s); off < found.off) found = {time_s, off};
  return found;
}

Trajectory resting(std::span<const double> q, double duration_s) {
  Trajectory out = make_trajectory(static_cast<int>(q.size()), 2, duration_s);
  std::ranges::copy(q, out.q(0).begin());
  std::ranges::copy(q, out.q(1).begin());
  return out;
}

GpPrior::GpPrior(Eigen::VectorXd qc, double dt_s) : qc_(std::move(qc)), dt_s_(dt_s) {
  // Q(dt)^-1 = [[12/dt^3, -6/dt^2], [-6/dt^2, 4/dt]] for Qc = 1.
  whitening_ << std::sqrt(12.0 / (dt_s * dt_s * dt_s)), -std::sqrt(3.0 / dt_s),  //
      0.0, std::sqrt(1.0 / dt_s);
}

GpPrior::Interpolation GpPrior::interpolation(double fraction) const noexcept {
  // Lambda(s) and Psi(s) multiplied out are the cubic Hermite basis: Qc cancels.
  const auto basis = hermite_basis(dt_s_, fraction);
  Interpolation at;
  at.lambda << 1.0 - basis.rise, basis.out, -basis.rise_rate, basis.out_rate;
  at.psi << basis.rise, basis.in, basis.rise_rate, basis.in_rate;
  return at;
}

void RobotMotion::add(History& history, const RobotState& state, Stamp stamp) const {
  if (!history.empty() &&
      (stamp <= history.back().stamp || state.q.size() != history.back().state.q.size())) {
    return;
  }
  history.push_back({stamp, state});
  RobotState& added = history.back().state;
  if (added.qdot.size() != added.q.size()) added.qdot.setZero(added.q.size());
  keep(history, stamp);
}

std::optional<RobotState> RobotMotion::at(const History& history, Stamp stamp) {
  const auto after = std::ranges::lower_bound(history, stamp, {}, &Sample<RobotState>::stamp);
  if (after == history.end()) return {};
  if (after->stamp == stamp) return after->state;
  if (after == history.begin()) return {};
  const auto before = std::prev(after);
  const double dt_s = static_cast<double>(after->stamp.ns - before->stamp.ns) * 1e-9;
  const double in_s = static_cast<double>(stamp.ns - before->stamp.ns) * 1e-9;
  const auto basis = hermite_basis(dt_s, in_s / dt_s);
  const RobotState& a = before->state;
  const RobotState& b = after->state;
  return RobotState{
      a.q + basis.rise * (b.q - a.q) + basis.out * a.qdot + basis.in * b.qdot,
      basis.rise_rate * (b.q - a.q) + basis.out_rate * a.qdot + basis.in_rate * b.qdot};
}

void RobotMotion::record(const RobotState& state, Stamp stamp) {
  const std::lock_guard lock(mutex_);
  add(measured_, state, stamp);
}

void RobotMotion::record_truth(const RobotState& state, Stamp stamp) {
  const std::lock_guard lock(mutex_);
  add(true_, state, stamp);
}

void RobotMotion::follow(Trajectory trajectory, Stamp start) {
  const std::lock_guard lock(mutex_);
  followed_ = std::move(trajectory);
  start_ = start;
}

std::optional<RobotState> RobotMotion::measured(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  return at(measured_, stamp);
}

std::optional<Stamp> RobotMotion::newest() const {
  const std::lock_guard lock(mutex_);
  if (measured_.empty()) return {};
  return measured_.back().stamp;
}

std::optional<RobotState> RobotMotion::truth(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  return at(true_.empty() ? measured_ : true_, stamp);
}

std::optional<RobotState> RobotMotion::planned(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  if (followed_.size() == 0) return {};
  const double time_s = static_cast<double>(stamp.ns - start_.ns) * 1e-9;
  RobotState state{Eigen::VectorXd(followed_.dof), Eigen::VectorXd(followed_.dof)};
  followed_.sample(time_s, as_span(state.q), as_span(state.qdot));
  if (time_s < 0.0 || time_s > followed_.duration_s()) state.qdot.setZero();
  return state;
}

void RobotMotion::record_head(const HeadAngles& angles, Stamp stamp) {
  const std::lock_guard lock(mutex_);
  if (!head_.empty() && stamp <= head_.back().stamp) return;
  head_.push_back({stamp, angles});
  keep(head_, stamp);
}

std::optional<HeadAngles> RobotMotion::head(Stamp stamp) const {
  const std::lock_guard lock(mutex_);
  const auto after = std::ranges::lower_bound(head_, stamp, {}, &Sample<HeadAngles>::stamp);
  if (after == head_.end()) return head_.empty() ? std::nullopt : std::optional(head_.back().state);
  if (after->stamp == stamp) return after->state;
  if (after == head_.begin()) return {};
  const auto& [begin, from] = *std::prev(after);
  const double share =
      static_cast<double>(stamp.ns - begin.ns) / static_cast<double>(after->stamp.ns - begin.ns);
  const auto between = [share](double a, double b) { return a + share * (b - a); };
  return HeadAngles{between(from.pan_rad, after->state.pan_rad),
                    between(from.tilt_rad, after->state.tilt_rad)};
}

}  // namespace sidestep
