#ifndef SIDESTEP_KERNELS
#include "path_stages.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace sidestep::detail {
namespace {

constexpr double kNoEffect = 1e-9;  ///< Of a unit tangent: the joint stands still.
constexpr double kEndless = 1e18;   ///< Beyond any speed squared.
constexpr double kRounding = 1e-12;
constexpr double kEndTolerance = 1e-5;  ///< Relative, of the given squared speeds at both ends.

constexpr double kNever = std::numeric_limits<double>::infinity();

struct Edge {
  double value, offset, slope;
};

}  // namespace

}  // namespace sidestep::detail

#define SIDESTEP_KERNELS "speed_profile.cpp"
#include <sidestep/core/each_target.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep::detail {

/// Rows: limits of velocity, of acceleration, of losing speed. What is beyond the joints never
/// binds.
void SpeedProfile::load_limits() {
  const std::size_t dof = limits_.velocity.size();
  width_ = padded(dof);
  rows_.assign_zeros(3 * width_);
  std::ranges::copy(limits_.velocity, rows_.data());
  std::ranges::copy(limits_.acceleration, rows_.data() + width_);
  if (is_stop_) std::ranges::copy(limits_.while_stopping(), rows_.data() + 2 * width_);
}

/// Rows of each stage: widths at both ends, slopes at both ends, in a stop the widths below at both
/// ends. They stay while the stages do, whatever shares of the limits are asked for.
void SpeedProfile::load_strips() {
  const auto count = idx(stages_.size());
  if (count == most_x_of_.size() && version_ == stages_.version()) return;
  version_ = stages_.version();
  strips_.assign_zeros(count * strip_rows() * width_);
  most_x_of_.resize(count);
  for (int i = 0; i < stages_.size(); ++i) {
    double* widths = strips_.data() + idx(i) * strip_rows() * width_;
    double* slopes = widths + 2 * width_;
    const auto write = [&](const double* limits, double* into) {
      const double from = SIDESTEP_DISPATCH(write_strips)(stages_.tangent_from(i).data(),
                                                          stages_.curvature_from(i).data(), 0.0,
                                                          limits, width_, into, slopes);
      const double to = SIDESTEP_DISPATCH(write_strips)(
          stages_.tangent_to(i).data(), stages_.curvature_to(i).data(), 2.0 * stages_[i].length,
          limits, width_, into + width_, slopes + width_);
      return std::min(from, to);
    };
    // A joint that does not feel u can only gain speed.
    most_x_of_[idx(i)] = write(rows_.data() + width_, widths);
    if (is_stop_) write(rows_.data() + 2 * width_, widths + 4 * width_);
  }
}

void SpeedProfile::limit_speeds(const Shares& shares) {
  fastest_.assign(idx(stages_.size()) + 1, kEndless);
  const auto limit = [&](std::size_t node, std::span<const double> tangent, double share) {
    const double speed =
        share * SIDESTEP_DISPATCH(fastest_along)(tangent.data(), rows_.data(), width_);
    fastest_[node] = std::min(fastest_[node], speed * speed);
  };
  for (int i = 0; i < stages_.size(); ++i) {
    limit(idx(i), stages_.tangent_from(i), shares.velocity[idx(i)]);
    limit(idx(i) + 1, stages_.tangent_to(i), shares.velocity[idx(i)]);
    if (stages_[i].stop_from) fastest_[idx(i)] = 0.0;
    if (stages_[i].stop_to) fastest_[idx(i) + 1] = 0.0;
  }
}

void SpeedProfile::load(int stage, double acceleration_share) {
  share_ = acceleration_share;
  twice_length_ = 2.0 * stages_[stage].length;
  widths_ = strips_.data() + idx(stage) * strip_rows() * width_;
  losses_ = is_stop_ ? widths_ + 4 * width_ : widths_;
  most_x_ = std::min(kEndless, share_ * most_x_of_[idx(stage)]);
}

SpeedProfile::Bounds SpeedProfile::bounds(double x) const noexcept {
  const double slope = -1.0 / twice_length_;
  const double low = next_.low / twice_length_, high = next_.high / twice_length_;
  Edge lower{low + slope * x, low, slope}, upper{high + slope * x, high, slope};
  SIDESTEP_DISPATCH(find_edges)
  (widths_, losses_, widths_ + 2 * width_, 2 * width_, share_, x, lower, upper);
  return {{lower.offset, lower.slope}, {upper.offset, upper.slope}};
}

std::optional<SpeedProfile::Interval> SpeedProfile::controllable(double x_max) const noexcept {
  // lower(x) - upper(x) is convex: Newton's method from outside walks to its roots monotonically
  // and ends, since the function has finitely many straight parts.
  const auto walk = [&](double x, double direction) -> std::optional<double> {
    const std::size_t most = 8 * width_ + 4;
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
  reach_.resize(idx(n) + 1);
  if (x_goal > fastest_[idx(n)] * (1.0 + kEndTolerance)) {
    obstruction_ = {n - 1, true};
    return false;
  }
  reach_[idx(n)] = {x_goal, x_goal};
  for (int i = n - 1; i >= 0; --i) {
    load(i, shares.acceleration[idx(i)]);
    next_ = reach_[idx(i) + 1];
    const auto interval = controllable(fastest_[idx(i)]);
    if (!interval) {
      obstruction_ = {i, true};
      return false;
    }
    reach_[idx(i)] = *interval;
  }
  return true;
}

void SpeedProfile::pass_forward(double x_start, const Shares& shares) {
  const int n = stages_.size();
  x_.resize(idx(n) + 1);
  x_[0] = x_start;
  for (int i = 0; i < n; ++i) {
    load(i, shares.acceleration[idx(i)]);
    next_ = reach_[idx(i) + 1];
    const double u = bounds(x_[idx(i)]).upper(x_[idx(i)]);
    x_[idx(i) + 1] = std::clamp(x_[idx(i)] + twice_length_ * u, next_.low, next_.high);
  }
}

int SpeedProfile::where_braking_fails(double x_start, const Shares& shares) {
  double x = x_start;
  for (int i = 0; i < stages_.size(); ++i) {
    load(i, shares.acceleration[idx(i)]);
    next_ = {0.0, kEndless};
    const Bounds here = bounds(x);
    const bool holds = x <= std::min(most_x_, fastest_[idx(i)]) * (1.0 + kEndTolerance) &&
                       here.lower(x) <= here.upper(x);
    if (!holds) return i;
    x = std::max(0.0, x + twice_length_ * here.lower(x));
  }
  return stages_.size() - 1;
}

std::optional<SpeedProfile::Rest> SpeedProfile::braking_end(double x_start,
                                                            double acceleration_share) {
  load_limits();
  load_strips();
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
  load_limits();
  load_strips();
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

#else

namespace {

using namespace detail;

/// The speed dl/dt that the joints' velocity limits allow.
double fastest_along(const double* tangent, const double* limits, std::size_t width) noexcept {
  Lanes speed = Lanes{} + kNever;
  for (std::size_t j = 0; j < width; j += kLanes) {
    const Lanes size = abs(lanes(tangent + j));
    speed = lesser(choose(size > kNoEffect, lanes(limits + j) / size, kNever), speed);
  }
  return least_of(speed);
}

/// A strip -width - slope x <= u <= width - slope x for each joint that feels u at one end of a
/// stage; returns the x that the others allow.
double write_strips(const double* tangent, const double* curvature, double twice_length,
                    const double* limits, std::size_t count, double* widths,
                    double* slopes) noexcept {
  Lanes most = Lanes{} + kNever;
  for (std::size_t j = 0; j < count; j += kLanes) {
    const Lanes across = lanes(curvature + j), limit = lanes(limits + j);
    const Lanes along = lanes(tangent + j) + twice_length * across;
    const Lanes along_size = abs(along), across_size = abs(across);
    const auto feels_along = along_size > kNoEffect;
    lanes(widths + j) = choose(feels_along, limit / along_size, kNever);
    lanes(slopes + j) = choose(feels_along, across / along, 0.0);
    const Lanes x_across = choose(across_size > kNoEffect, limit / across_size, kNever);
    most = lesser(choose(feels_along, Lanes{} + kNever, x_across), most);
  }
  return least_of(most);
}

/// The least upper and the greatest lower edge of the strips at an x, where they bind more than
/// those given. Above, a joint gains speed; below, it loses it, by `losses`.
void find_edges(const double* widths, const double* losses, const double* slopes, std::size_t count,
                double share, double x, Edge& lower, Edge& upper) noexcept {
  Lanes high = Lanes{} + kNever, low = -high;
  Lanes high_offset{}, high_slope{}, low_offset{}, low_slope{};
  for (std::size_t j = 0; j < count; j += kLanes) {
    const Lanes width = share * lanes(widths + j), loss = share * lanes(losses + j);
    const Lanes slope = -lanes(slopes + j);
    const Lanes above = slope * x + width, below = slope * x - loss;
    const auto is_lower = above<high, is_higher = below> low;
    high_offset = choose(is_lower, width, high_offset);
    high_slope = choose(is_lower, slope, high_slope);
    high = choose(is_lower, above, high);
    low_offset = choose(is_higher, -loss, low_offset);
    low_slope = choose(is_higher, slope, low_slope);
    low = choose(is_higher, below, low);
  }
  for (std::size_t i = 0; i < kLanes; ++i) {
    if (high[i] < upper.value) upper = {high[i], high_offset[i], high_slope[i]};
    if (low[i] > lower.value) lower = {low[i], low_offset[i], low_slope[i]};
  }
}

}  // namespace

#endif
