#include <sidestep/trajectory/retime.hpp>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "path_stages.hpp"
#include "rolling_way.hpp"

namespace sidestep {
namespace {

using detail::PathStages;
using detail::SpeedProfile;

constexpr double kInside = 1e-6;    ///< Share of the limits that is kept free for rounding.
constexpr double kLower = 1e-4;     ///< A share is lowered by so much more than it should need.
constexpr double kLeast_s = 1e-3;   ///< Duration of a motion that stays put.
constexpr double kStaysPut = 1e-9;  ///< A path this short, in m or rad, is none.
constexpr double kCoarse = 1.02;    ///< A stage that breaks a limit by more is too long.
constexpr int kMaxRounds = 40;
constexpr int kMostStages = 20;      ///< Times as many as at first.
constexpr int kMaxTries = 3;         ///< With a lower share; then the stage is too long, too.
constexpr double kRounding = 1e-15;  ///< Of positions, relative.

std::string number(double value) { return format("%.4g", value); }

Result<void> check(const Trajectory& path, const MotionLimits& limits,
                   const RetimeSettings& settings) {
  SIDESTEP_TRY(path.validate());
  const auto dof = idx(path.dof);
  if (limits.velocity.size() != dof || limits.acceleration.size() != dof) {
    return invalid("there are limits of " + std::to_string(limits.velocity.size()) +
                   " velocities and " + std::to_string(limits.acceleration.size()) +
                   " accelerations for a path of " + std::to_string(dof) + " joints");
  }
  for (std::size_t j = 0; j < dof; ++j) {
    if (limits.velocity[j] >= 0.0 && limits.acceleration[j] >= 0.0) continue;  // false for NaN
    return invalid("the limits of " + limits.joint_name(j) +
                   " are negative or not numbers: velocity " + number(limits.velocity[j]) +
                   ", acceleration " + number(limits.acceleration[j]));
  }
  if (settings.is_stop && limits.while_stopping().size() != dof) {
    return invalid("there are limits of braking of " +
                   std::to_string(limits.while_stopping().size()) + " joints for a path of " +
                   std::to_string(dof));
  }
  if (settings.least_stages < 1 || settings.least_stages > 1'000'000) {
    return invalid("a path cannot be cut into " + std::to_string(settings.least_stages) +
                   " stages");
  }
  if (!(settings.max_deviation > 0.0)) {
    return invalid("the largest deviation from a path must be positive, not " +
                   number(settings.max_deviation));
  }
  return {};
}

constexpr double kNoEffect = 1e-9;        ///< Of a unit tangent: the joint stands still.
constexpr double kLeastLineShare = 1e-6;  ///< Of the path.
constexpr double kLeastStretch = 1e-3;    ///< Of a line: less of it at full speed is none.

double length_of(const Trajectory& path, int line) {
  const auto from = path.q(line), to = path.q(line + 1);
  double squares = 0.0;
  for (std::size_t j = 0; j < from.size(); ++j) squares += (to[j] - from[j]) * (to[j] - from[j]);
  return std::sqrt(squares);
}

/// Cosine of the angle between a line and the next.
double cosine_at(const Trajectory& path, int line, std::span<const double> lengths) {
  const auto a = path.q(line), b = path.q(line + 1), c = path.q(line + 2);
  double product = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) product += (b[j] - a[j]) * (c[j] - b[j]);
  const auto at = idx(line);
  return product / (lengths[at] * lengths[at + 1]);
}

/// Speed and acceleration that the limits allow along a line.
struct Along {
  double speed = kInfinity;
  double acceleration = kInfinity;
};

Along allowed_along(const Trajectory& path, int line, double length, const MotionLimits& limits) {
  const auto from = path.q(line), to = path.q(line + 1);
  Along along;
  for (std::size_t j = 0; j < from.size(); ++j) {
    const double part = std::abs(to[j] - from[j]) / length;
    if (part <= kNoEffect) continue;
    // One without any limit is for the caller to tell.
    if (std::isinf(limits.velocity[j]) && std::isinf(limits.acceleration[j])) return {};
    along.speed = std::min(along.speed, limits.velocity[j] / part);
    along.acceleration = std::min(along.acceleration, limits.acceleration[j] / part);
  }
  return along;
}

/// The fastest motion along a path that stands still at each of its states, so that its pieces are
/// straight lines, and turns at each between: every line takes a ramp up, a stretch at full speed
/// and a ramp down, each a cubic piece of its own. All that is known in closed form.
///
/// Keeps a share `kept_free` of the limits free. Nothing for all other paths: that pass a state, do
/// not turn at one by as much as `same_direction` (a cosine) tells, have a line shorter than a
/// millionth of them, or a joint that moves with a limit that is zero or infinite.
std::optional<Trajectory> stop_and_go(const Trajectory& path, const MotionLimits& limits,
                                      double kept_free, double same_direction) {
  const auto is_zero = [](double value) { return value == 0.0; };
  if (path.size() < 2 || !std::ranges::all_of(path.velocities, is_zero)) return std::nullopt;
  const int lines = path.size() - 1;
  std::vector<double> lengths;
  double total = 0.0;
  for (int line = 0; line < lines; ++line) total += lengths.emplace_back(length_of(path, line));
  if (!(*std::ranges::min_element(lengths) > kLeastLineShare * total)) return std::nullopt;
  for (int line = 0; line + 1 < lines; ++line) {
    if (!(cosine_at(path, line, lengths) < same_direction)) return std::nullopt;
  }
  Trajectory motion;
  motion.dof = path.dof;
  // The state `way` into a line of `length`, with a speed, so long after the one before.
  const auto add = [&](int line, double way, double length, double speed, double after_s) {
    motion.times_s.push_back(motion.times_s.empty() ? 0.0 : motion.times_s.back() + after_s);
    const auto from = path.q(line), to = path.q(line + 1);
    for (std::size_t j = 0; j < from.size(); ++j) {
      const double step = to[j] - from[j];
      motion.positions.push_back(way < length ? from[j] + way / length * step : to[j]);
      motion.velocities.push_back(speed / length * step);
    }
  };
  add(0, 0.0, lengths.front(), 0.0, 0.0);
  for (int line = 0; line < lines; ++line) {
    const double length = lengths[idx(line)];
    const Along along = allowed_along(path, line, length, limits);
    const double fastest = (1.0 - kept_free) * along.speed;
    double ramp = (1.0 - kept_free) * along.acceleration;
    if (!(ramp > 0.0 && fastest > 0.0) || std::isinf(ramp)) return std::nullopt;
    if (fastest * fastest < (1.0 - kLeastStretch) * length * ramp) {
      const double ramp_s = fastest / ramp, ramp_way = 0.5 * fastest * ramp_s;
      const double stretch = length - 2.0 * ramp_way;
      add(line, ramp_way, length, fastest, ramp_s);
      add(line, ramp_way + stretch, length, fastest, stretch / fastest);
      add(line, length, length, 0.0, ramp_s);
      continue;
    }
    ramp = std::min(ramp, fastest * fastest / length);
    const double ramp_s = std::sqrt(length / ramp);
    add(line, 0.5 * length, length, ramp * ramp_s, ramp_s);
    add(line, length, length, 0.0, ramp_s);
  }
  return motion;
}

/// What a stage's cubic piece, as it will be sent, makes of the limits: 1 is all of them.
struct Use {
  double velocity = 0.0;
  double acceleration = 0.0;
  double deviation = 0.0;
};

class Retimer {
 public:
  Retimer(const Trajectory& path, const MotionLimits& limits, const RetimeSettings& settings)
      : path_(path),
        limits_(limits),
        settings_(settings),
        stages_(path, settings.least_stages),
        profile_(stages_, limits_, settings.is_stop && !limits.braking.empty()) {
    if (!settings.is_stop) limits_.braking.clear();
  }

  Result<Retiming> run() {
    middle_.resize(dof());
    if (!(stages_.length() > kStaysPut) || stages_.size() == 0) return at_rest();
    SIDESTEP_TRY(release_resting_joints());
    const int last = path_.size() - 1;
    for (const auto& [state, which] : {std::pair(0, "start"), std::pair(last, "goal")}) {
      if (state == last && settings_.stop_at_goal) continue;
      SIDESTEP_TRY(check_end(state, which));
    }
    const double x_start = squared_speed(0, stages_[0].still_from);
    const double x_goal =
        settings_.stop_at_goal ? 0.0 : squared_speed(last, stages_[stages_.size() - 1].still_to);
    SpeedProfile::Shares shares;
    shares.velocity.assign(idx(stages_.size()), 1.0 - kInside);
    shares.acceleration = shares.velocity;
    const int most = kMostStages * stages_.size();
    for (int round = 0; round < kMaxRounds && stages_.size() <= most; ++round) {
      if (!profile_.solve(x_start, x_goal, shares)) return tl::make_unexpected(obstruction());
      write_motion();
      if (!refine(shares)) return std::move(out_);
    }
    return invalid(
        "the path turns too sharply to be timed: cut into " + std::to_string(stages_.size()) +
        " stages its motion still breaks a limit or leaves the path by " + number(out_.deviation));
  }

 private:
  [[nodiscard]] std::size_t dof() const noexcept { return idx(path_.dof); }
  /// Joints that never move cannot break a limit; those that do need one that lets them.
  [[nodiscard]] Result<void> release_resting_joints() {
    std::vector<double> share(dof(), 0.0);
    for (int i = 0; i < stages_.size(); ++i) {
      const auto from = stages_.tangent_from(i), to = stages_.tangent_to(i);
      for (std::size_t j = 0; j < dof(); ++j) {
        share[j] = std::max({share[j], std::abs(from[j]), std::abs(to[j])});
      }
    }
    constexpr double kStands = 1e-9;
    for (std::size_t j = 0; j < dof(); ++j) {
      double& velocity = limits_.velocity[j];
      double& acceleration = limits_.acceleration[j];
      if (share[j] <= kStands) {
        velocity = acceleration = kInfinity;
        if (!limits_.braking.empty()) limits_.braking[j] = kInfinity;
      } else if (velocity == 0.0 || acceleration == 0.0) {
        return invalid(limits_.joint_name(j) + " moves on the path, but its limit of " +
                       (velocity == 0.0 ? "velocity" : "acceleration") + " is zero");
      } else if (std::isinf(velocity) && std::isinf(acceleration)) {
        return invalid(limits_.joint_name(j) + " moves without a limit: no motion is the fastest");
      }
    }
    return {};
  }

  [[nodiscard]] Result<void> check_end(int state, std::string_view which) {
    constexpr double kTolerance = 1e-6;
    for (std::size_t j = 0; j < dof(); ++j) {
      const double speed = std::abs(path_.qdot(state)[j]);
      if (speed <= limits_.velocity[j] * (1.0 + kTolerance)) {
        limits_.velocity[j] = std::max(limits_.velocity[j], speed);  // rounding
        continue;
      }
      return invalid(limits_.joint_name(j) + " moves at " + number(speed) + " at the " +
                     std::string(which) + " of the path, beyond its velocity limit of " +
                     number(limits_.velocity[j]));
    }
    return {};
  }

  [[nodiscard]] double squared_speed(int state, bool still) const {
    if (still) return 0.0;
    double sum = 0.0;
    for (const double v : path_.qdot(state)) sum += v * v;
    return sum;
  }

  /// How long a stage takes that lies between two stops, as the cubic piece that it becomes: at its
  /// ends it accelerates by 6 l / t^2, and in its middle it moves at 1.5 l / t.
  [[nodiscard]] double from_rest_to_rest_s(int stage) const {
    const double length = stages_[stage].length;
    const auto tangent = stages_.tangent_from(stage);
    double least_s = 0.0;
    for (std::size_t j = 0; j < dof(); ++j) {
      const double way = std::abs(tangent[j]) * length / (1.0 - kInside);
      least_s = std::max({least_s, std::sqrt(6.0 * way / limits_.acceleration[j]),
                          1.5 * way / limits_.velocity[j]});
    }
    return std::max(least_s, kLeast_s);
  }

  /// The states at the ends of the stages, with the profile's speeds and times.
  void write_motion() {
    const int n = stages_.size();
    const std::vector<double>& x = profile_.x();
    Trajectory& motion = out_.trajectory;
    motion = make_trajectory(path_.dof, n + 1, 0.0);
    double speed = std::sqrt(x.front());
    for (int i = 0; i <= n; ++i) {
      const auto k = idx(i);
      const bool last = i == n;
      last ? stages_.position_to(n - 1, motion.q(i)) : stages_.position_from(i, motion.q(i));
      const auto tangent = last ? stages_.tangent_to(n - 1) : stages_.tangent_from(i);
      for (std::size_t j = 0; j < dof(); ++j) motion.qdot(i)[j] = speed * tangent[j];
      if (last) break;
      const double next = std::sqrt(x[k + 1]);
      const double sum = speed + next;
      const double took_s = sum > 0.0 ? 2.0 * stages_[i].length / sum : from_rest_to_rest_s(i);
      motion.times_s[k + 1] = motion.times_s[k] + took_s;
      speed = next;
    }
  }

  [[nodiscard]] Use use_of(int stage) {
    const Trajectory& motion = out_.trajectory;
    const auto k = idx(stage);
    const double h = motion.times_s[k + 1] - motion.times_s[k];
    const auto q0 = motion.q(stage), q1 = motion.q(stage + 1);
    const auto v0 = motion.qdot(stage), v1 = motion.qdot(stage + 1);
    Use use;
    for (std::size_t j = 0; j < dof(); ++j) {
      const double slope = (q1[j] - q0[j]) / h;
      const double a0 = (6.0 * slope - 4.0 * v0[j] - 2.0 * v1[j]) / h;
      const double a1 = (4.0 * v1[j] + 2.0 * v0[j] - 6.0 * slope) / h;
      double fastest = std::max(std::abs(v0[j]), std::abs(v1[j]));
      if (a0 * a1 < 0.0) {
        fastest = std::max(fastest, std::abs(v0[j] + 0.5 * h * a0 * a0 / (a0 - a1)));
      }
      // What the positions' last digits make of an acceleration is no acceleration.
      const double noise = 12.0 * kRounding * (std::abs(q0[j]) + std::abs(q1[j])) / (h * h);
      use.velocity = std::max(use.velocity, fastest / limits_.velocity[j]);
      const auto add = [&](double a, double limit) {
        use.acceleration = std::max(use.acceleration, std::max(0.0, a - noise) / limit);
      };
      if (limits_.braking.empty()) {
        add(std::max(std::abs(a0), std::abs(a1)), limits_.acceleration[j]);
      } else {
        const auto limit = [&](double a, double v) {
          const bool is_losing = a * (v != 0.0 ? v : slope) < 0.0;
          return is_losing ? limits_.braking[j] : limits_.acceleration[j];
        };
        add(std::abs(a0), limit(a0, v0[j]));
        add(std::abs(a1), limit(a1, v1[j]));
      }
      middle_[j] = 0.5 * (q0[j] + q1[j]) + 0.125 * h * (v0[j] - v1[j]);
    }
    use.deviation = stages_.distance(stage, middle_);
    return use;
  }

  /// Halves stages that are too coarse and lowers the share of the limits where a piece between two
  /// states on the path goes beyond them; false if there is nothing to improve.
  [[nodiscard]] bool refine(SpeedProfile::Shares& shares) {
    const auto n = idx(stages_.size());
    std::vector<char> halved(n);
    tries_.resize(n);
    bool improved = false, coarse = false;
    out_.deviation = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Use use = use_of(static_cast<int>(i));
      const double most = std::max(use.velocity, use.acceleration);
      out_.deviation = std::max(out_.deviation, use.deviation);
      halved[i] = most > kCoarse || use.deviation > settings_.max_deviation ||
                  (most > 1.0 && tries_[i] == kMaxTries);
      coarse |= halved[i] != 0;
      improved |= halved[i] != 0 || most > 1.0;
      if (halved[i] || most <= 1.0) continue;
      ++tries_[i];
      if (use.velocity > 1.0) shares.velocity[i] *= (1.0 - kLower) / use.velocity;
      if (use.acceleration > 1.0) shares.acceleration[i] *= (1.0 - kLower) / use.acceleration;
    }
    if (!coarse) return improved;
    SpeedProfile::Shares finer;
    std::vector<int> tries;
    for (std::size_t i = 0; i < n; ++i) {
      const int parts = halved[i] ? stages_.parts_of(static_cast<int>(i)) : 1;
      for (int part = 0; part < parts; ++part) {
        finer.velocity.push_back(shares.velocity[i]);
        finer.acceleration.push_back(shares.acceleration[i]);
        tries.push_back(halved[i] ? 0 : tries_[i]);
      }
    }
    shares = std::move(finer);
    tries_ = std::move(tries);
    stages_.halve(halved);
    return true;
  }

  [[nodiscard]] Error obstruction() const {
    const detail::Obstruction& found = profile_.obstruction();
    const double time_s = stages_.begin_s(found.stage);
    const std::string where =
        number(time_s) + " s along the path, of " + number(path_.duration_s()) + " s";
    if (found.at_goal) {
      return Error{
          ErrorCode::kInvalidArgument,
          "the path cannot be followed to its goal's velocity within the limits of velocity "
          "and acceleration: no speed does from " +
              where,
          {},
          "let the goal be passed more slowly, or give the path more way before it",
          nullptr};
    }
    return Error{
        ErrorCode::kInvalidArgument,
        "the path cannot be followed from its start's velocity within the limits of velocity "
        "and acceleration: even braking hardest it is left " +
            where,
        {},
        "start more slowly, or give the path more way before it turns",
        nullptr};
  }

  [[nodiscard]] Retiming at_rest() const {
    Retiming out;
    out.trajectory = resting(path_.q(0), kLeast_s);
    const int last = path_.size() - 1;
    for (std::size_t j = 0; j < dof(); ++j) {
      out.deviation = std::max(out.deviation, std::abs(path_.q(last)[j] - path_.q(0)[j]));
    }
    return out;
  }

  const Trajectory& path_;
  MotionLimits limits_;  ///< `braking` of a stop alone.
  const RetimeSettings& settings_;
  PathStages stages_;
  SpeedProfile profile_;
  Retiming out_;
  std::vector<double> middle_;
  std::vector<int> tries_;  ///< Per stage: how often its share has been lowered.
};
}  // namespace

Result<Retiming> retime(const Trajectory& path, const MotionLimits& limits,
                        const RetimeSettings& settings) {
  SIDESTEP_TRY(check(path, limits, settings));
  if (limits.rolling) {
    const RollingBase base = *limits.rolling;
    // What slips a little, as trajectories that costs make roll, is made to roll first.
    Trajectory rolling = path;
    (void)roll(base, rolling);
    auto timed =
        SIDESTEP_TRY(retime(detail::with_way(rolling, base), detail::with_way(limits), settings));
    timed.trajectory = detail::without_way(timed.trajectory);
    (void)roll(base, timed.trajectory);  // what slips is for checks to find
    return timed;
  }
  auto motion = stop_and_go(path, limits, kInside, PathStages::kSameDirection);
  if (motion) return Retiming{std::move(*motion), 0.0};
  return Retimer(path, limits, settings).run();
}

}  // namespace sidestep
