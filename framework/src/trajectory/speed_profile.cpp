#include "speed_profile.hpp"

#include <algorithm>
#include <cmath>

namespace sidestep::detail {
namespace {

constexpr double kNoEffect = 1e-9;  ///< Of a unit tangent: the joint stands still.
constexpr double kEndless = 1e18;   ///< Beyond any speed squared.
constexpr double kRounding = 1e-12;
constexpr double kEndTolerance = 1e-5;  ///< Relative, of the given squared speeds at both ends.

std::size_t at(int i) { return static_cast<std::size_t>(i); }

}  // namespace

void SpeedProfile::limit_speeds(const Shares& shares) {
  fastest_.assign(at(stages_.size()) + 1, kEndless);
  const auto limit = [&](std::size_t node, std::span<const double> tangent, double share) {
    for (std::size_t j = 0; j < tangent.size(); ++j) {
      if (std::abs(tangent[j]) <= kNoEffect || std::isinf(limits_.velocity[j])) continue;
      const double speed = share * limits_.velocity[j] / tangent[j];
      fastest_[node] = std::min(fastest_[node], speed * speed);
    }
  };
  for (int i = 0; i < stages_.size(); ++i) {
    limit(at(i), stages_.tangent_from(i), shares.velocity[at(i)]);
    limit(at(i) + 1, stages_.tangent_to(i), shares.velocity[at(i)]);
    if (stages_[i].stop_from) fastest_[at(i)] = 0.0;
    if (stages_[i].stop_to) fastest_[at(i) + 1] = 0.0;
  }
}

void SpeedProfile::add_strip(double along, double across, double limit) {
  if (std::abs(along) > kNoEffect) {
    strips_.push_back({limit / std::abs(along), across / along});
  } else if (std::abs(across) > kNoEffect) {
    most_x_ = std::min(most_x_, limit / std::abs(across));
  }
}

void SpeedProfile::load(int stage, double acceleration_share) {
  strips_.clear();
  most_x_ = kEndless;
  twice_length_ = 2.0 * stages_[stage].length;
  const auto tangent_from = stages_.tangent_from(stage), tangent_to = stages_.tangent_to(stage);
  const auto bend_from = stages_.curvature_from(stage), bend_to = stages_.curvature_to(stage);
  for (std::size_t j = 0; j < tangent_from.size(); ++j) {
    const double limit = acceleration_share * limits_.acceleration[j];
    if (std::isinf(limit)) continue;
    add_strip(tangent_from[j], bend_from[j], limit);
    add_strip(tangent_to[j] + twice_length_ * bend_to[j], bend_to[j], limit);
  }
}

SpeedProfile::Bounds SpeedProfile::bounds(double x) const noexcept {
  Bounds at_x{{next_.low / twice_length_, -1.0 / twice_length_},
              {next_.high / twice_length_, -1.0 / twice_length_}};
  double lower = at_x.lower(x), upper = at_x.upper(x);
  for (const Strip& strip : strips_) {
    const double middle = -strip.slope * x;
    if (middle + strip.width < upper) {
      upper = middle + strip.width;
      at_x.upper = {strip.width, -strip.slope};
    }
    if (middle - strip.width > lower) {
      lower = middle - strip.width;
      at_x.lower = {-strip.width, -strip.slope};
    }
  }
  return at_x;
}

std::optional<SpeedProfile::Interval> SpeedProfile::controllable(double x_max) const noexcept {
  // lower(x) - upper(x) is convex: Newton's method from outside walks to its roots monotonically
  // and ends, since the function has finitely many straight parts.
  const auto walk = [&](double x, double direction) -> std::optional<double> {
    const std::size_t most = 4 * strips_.size() + 4;
    for (std::size_t step = 0; step < most; ++step) {
      const Bounds here = bounds(x);
      const double lower = here.lower(x), upper = here.upper(x);
      if (lower - upper <= kRounding * (std::abs(lower) + std::abs(upper))) return x;
      const double slope = here.lower.slope - here.upper.slope;
      if (!(slope * direction < 0.0)) return std::nullopt;
      const double root = (here.upper.offset - here.lower.offset) / slope;
      if (!((root - x) * direction > 0.0)) return x;  // as near as numbers get
      x = root;
    }
    return x;
  };
  const auto high = walk(std::min(x_max, most_x_), -1.0);
  if (!high || *high < 0.0) return std::nullopt;
  const auto low = walk(0.0, 1.0);
  if (!low || *low > *high) return std::nullopt;
  return Interval{*low, *high};
}

bool SpeedProfile::pass_backward(double x_goal, const Shares& shares) {
  const int n = stages_.size();
  reach_.resize(at(n) + 1);
  if (x_goal > fastest_[at(n)] * (1.0 + kEndTolerance)) {
    obstruction_ = {n - 1, true};
    return false;
  }
  reach_[at(n)] = {x_goal, x_goal};
  for (int i = n - 1; i >= 0; --i) {
    load(i, shares.acceleration[at(i)]);
    next_ = reach_[at(i) + 1];
    const auto interval = controllable(fastest_[at(i)]);
    if (!interval) {
      obstruction_ = {i, true};
      return false;
    }
    reach_[at(i)] = *interval;
  }
  return true;
}

void SpeedProfile::pass_forward(double x_start, const Shares& shares) {
  const int n = stages_.size();
  x_.resize(at(n) + 1);
  x_[0] = x_start;
  for (int i = 0; i < n; ++i) {
    load(i, shares.acceleration[at(i)]);
    next_ = reach_[at(i) + 1];
    const double u = bounds(x_[at(i)]).upper(x_[at(i)]);
    x_[at(i) + 1] = std::clamp(x_[at(i)] + twice_length_ * u, next_.low, next_.high);
  }
}

int SpeedProfile::where_braking_fails(double x_start, const Shares& shares) {
  double x = x_start;
  for (int i = 0; i < stages_.size(); ++i) {
    load(i, shares.acceleration[at(i)]);
    next_ = {0.0, kEndless};
    const Bounds here = bounds(x);
    const bool holds = x <= std::min(most_x_, fastest_[at(i)]) * (1.0 + kEndTolerance) &&
                       here.lower(x) <= here.upper(x);
    if (!holds) return i;
    x = std::max(0.0, x + twice_length_ * here.lower(x));
  }
  return stages_.size() - 1;
}

std::optional<SpeedProfile::Rest> SpeedProfile::braking_end(double x_start,
                                                            double acceleration_share) {
  double x = x_start;
  for (int i = 0; i < stages_.size(); ++i) {
    load(i, acceleration_share);
    next_ = {-kEndless, kEndless};
    const Bounds here = bounds(x);
    const double u = here.lower(x);
    if (x > most_x_ || u > here.upper(x)) return std::nullopt;
    const double next = x + twice_length_ * u;
    if (next <= 0.0) return Rest{i, x > 0.0 ? x / (x - next) : 0.0};
    if (stages_[i].stop_to) return std::nullopt;
    x = next;
  }
  return std::nullopt;
}

bool SpeedProfile::solve(double x_start, double x_goal, const Shares& shares) {
  limit_speeds(shares);
  // Speeds at the ends are given: a share that is lowered for the sake of what lies between must
  // not forbid them.
  if (!stages_[0].stop_from) fastest_.front() = std::max(fastest_.front(), x_start);
  if (!stages_[stages_.size() - 1].stop_to) fastest_.back() = std::max(fastest_.back(), x_goal);
  if (!pass_backward(x_goal, shares)) return false;
  const Interval start = reach_.front();
  if (x_start > start.high * (1.0 + kEndTolerance)) {
    obstruction_ = {where_braking_fails(x_start, shares), false};
    return false;
  }
  if (x_start < start.low * (1.0 - kEndTolerance)) {
    obstruction_ = {stages_.size() - 1, true};
    return false;
  }
  pass_forward(std::clamp(x_start, start.low, start.high), shares);
  return true;
}

}  // namespace sidestep::detail
