#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "clearance_prover.hpp"

namespace sidestep {

/// One joint between two support states: q0 + v0 s + c2 s^2 + c3 s^3, s seconds after the first.
struct Cubic {
  double q0 = 0.0;
  double v0 = 0.0;
  double c2 = 0.0;
  double c3 = 0.0;

  [[nodiscard]] static Cubic hermite(double q0, double v0, double q1, double v1,
                                     double h) noexcept {
    const double slope = (q1 - q0) / h;
    return {q0, v0, (3.0 * slope - 2.0 * v0 - v1) / h, (v0 + v1 - 2.0 * slope) / (h * h)};
  }
  [[nodiscard]] double position(double s) const noexcept {
    return q0 + s * (v0 + s * (c2 + s * c3));
  }
  [[nodiscard]] double velocity(double s) const noexcept {
    return v0 + s * (2.0 * c2 + s * 3.0 * c3);
  }
  [[nodiscard]] double acceleration(double s) const noexcept { return 2.0 * c2 + s * 6.0 * c3; }
  /// Where the velocity is extreme; NaN where it is linear.
  [[nodiscard]] double inflection() const noexcept {
    return c3 == 0.0 ? std::nan("") : -c2 / (3.0 * c3);
  }
  /// Where the velocity is zero, ascending; NaN for roots that do not exist.
  [[nodiscard]] std::array<double, 2> turning_points() const noexcept {
    const double a = 3.0 * c3;
    const double half_b = c2;
    const double discriminant = half_b * half_b - a * v0;
    if (!(discriminant >= 0.0)) return {std::nan(""), std::nan("")};
    const double sum = -(half_b + std::copysign(std::sqrt(discriminant), half_b));
    double first = sum == 0.0 ? 0.0 : v0 / sum;
    double second = a == 0.0 ? std::nan("") : sum / a;
    if (first > second) std::swap(first, second);
    return {first, second};
  }
  /// Length of the way from s = a to s = b, there and back counted both.
  [[nodiscard]] double variation(double a, double b) const noexcept {
    return variation(a, b, turning_points());
  }
  /// The same where the turning points are known.
  [[nodiscard]] double variation(double a, double b,
                                 const std::array<double, 2>& turns) const noexcept {
    double total = 0.0;
    double from = a;
    for (const double turn : turns) {
      if (!(turn > from && turn < b)) continue;
      total += std::abs(position(turn) - position(from));
      from = turn;
    }
    return total + std::abs(position(b) - position(from));
  }
};

/// A trajectory between two of its support states.
class CubicMotion {
 public:
  CubicMotion() = default;
  CubicMotion(const Trajectory& trajectory, int state) { take(trajectory, state); }
  void take(const Trajectory& trajectory, int state) {
    const std::size_t dof = idx(trajectory.dof);
    begin_s_ = trajectory.times_s[idx(state)];
    const double h = trajectory.times_s[idx(state) + 1] - begin_s_;
    duration_s_ = h;
    joints_.resize(dof);
    turns_.resize(dof);
    for (std::size_t j = 0; j < dof; ++j) {
      joints_[j] = Cubic::hermite(trajectory.q(state)[j], trajectory.qdot(state)[j],
                                  trajectory.q(state + 1)[j], trajectory.qdot(state + 1)[j], h);
      turns_[j] = joints_[j].turning_points();
    }
  }
  /// Cubic::variation() of a joint.
  [[nodiscard]] double variation(std::size_t joint, double a, double b) const noexcept {
    return joints_[joint].variation(a, b, turns_[joint]);
  }
  /// Where a joint's velocity is zero, as Cubic::turning_points().
  [[nodiscard]] const std::array<double, 2>& turns(std::size_t joint) const noexcept {
    return turns_[joint];
  }
  [[nodiscard]] const std::vector<Cubic>& joints() const noexcept { return joints_; }
  [[nodiscard]] double begin_s() const noexcept { return begin_s_; }
  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }
  [[nodiscard]] double end_s() const noexcept { return begin_s_ + duration_s_; }

 private:
  double begin_s_ = 0.0;
  double duration_s_ = 0.0;
  std::vector<Cubic> joints_;
  std::vector<std::array<double, 2>> turns_;
};

/// Several such pieces, one after the other.
class CubicChain final : public Motion {
 public:
  /// Keeps the memory of its pieces.
  void clear() noexcept { size_ = 0; }
  const CubicMotion& append(const Trajectory& trajectory, int state) {
    if (size_ == pieces_.size()) pieces_.emplace_back();
    pieces_[size_].take(trajectory, state);
    return pieces_[size_++];
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  void configuration(double t, std::span<double> q) const override {
    const CubicMotion& piece = *piece_at(t);
    for (std::size_t j = 0; j < q.size(); ++j) {
      q[j] = piece.joints()[j].position(t - piece.begin_s());
    }
  }
  void variation(double from, double to, std::span<double> v) const override {
    std::fill(v.begin(), v.end(), 0.0);
    for (const CubicMotion* piece = piece_at(from); piece != end(); ++piece) {
      const bool is_first = piece == pieces_.data() || piece->begin_s() <= from;
      const bool is_last = piece + 1 == end() || piece->end_s() >= to;
      const double a = is_first ? from - piece->begin_s() : 0.0;
      const double b = is_last ? to - piece->begin_s() : piece->duration_s();
      for (std::size_t j = 0; j < v.size(); ++j) v[j] += piece->variation(j, a, b);
      if (is_last) return;
    }
  }

 private:
  [[nodiscard]] const CubicMotion* end() const noexcept { return pieces_.data() + size_; }
  /// The last one that begins no later than t, else the first.
  [[nodiscard]] const CubicMotion* piece_at(double t) const {
    const CubicMotion* after = std::upper_bound(
        pieces_.data(), end(), t,
        [](double time, const CubicMotion& piece) { return time < piece.begin_s(); });
    return after == pieces_.data() ? after : after - 1;
  }

  std::vector<CubicMotion> pieces_;  ///< The first size_ of them.
  std::size_t size_ = 0;
};

}  // namespace sidestep
