#include "stop_and_go.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace sidestep::detail {
namespace {

constexpr double kNoEffect = 1e-9;      ///< Of a unit tangent: the joint stands still.
constexpr double kLeastLine = 1e-6;     ///< Of the path.
constexpr double kLeastStretch = 1e-3;  ///< Of a line: less of it at full speed is none.

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
  const auto at = static_cast<std::size_t>(line);
  return product / (lengths[at] * lengths[at + 1]);
}

/// Speed and acceleration that the limits allow along a line.
struct Along {
  double speed = std::numeric_limits<double>::infinity();
  double acceleration = std::numeric_limits<double>::infinity();
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

class Writer {
 public:
  explicit Writer(const Trajectory& path) : path_(path) { motion_.dof = path.dof; }

  /// The state `way` into a line of `length`, with a speed, so long after the one before.
  void add(int line, double way, double length, double speed, double after_s) {
    motion_.times_s.push_back(motion_.times_s.empty() ? 0.0 : motion_.times_s.back() + after_s);
    const auto from = path_.q(line), to = path_.q(line + 1);
    for (std::size_t j = 0; j < from.size(); ++j) {
      const double step = to[j] - from[j];
      motion_.positions.push_back(way < length ? from[j] + way / length * step : to[j]);
      motion_.velocities.push_back(speed / length * step);
    }
  }
  [[nodiscard]] Trajectory&& take() { return std::move(motion_); }

 private:
  const Trajectory& path_;
  Trajectory motion_;
};

}  // namespace

std::optional<Trajectory> stop_and_go(const Trajectory& path, const MotionLimits& limits,
                                      double kept_free, double same_direction) {
  const auto is_zero = [](double value) { return value == 0.0; };
  if (path.size() < 2 || !std::ranges::all_of(path.velocities, is_zero)) return std::nullopt;
  const int lines = path.size() - 1;
  std::vector<double> lengths;
  double total = 0.0;
  for (int line = 0; line < lines; ++line) total += lengths.emplace_back(length_of(path, line));
  if (!(*std::ranges::min_element(lengths) > kLeastLine * total)) return std::nullopt;
  for (int line = 0; line + 1 < lines; ++line) {
    if (!(cosine_at(path, line, lengths) < same_direction)) return std::nullopt;
  }
  Writer writer(path);
  writer.add(0, 0.0, lengths.front(), 0.0, 0.0);
  for (int line = 0; line < lines; ++line) {
    const double length = lengths[static_cast<std::size_t>(line)];
    const Along along = allowed_along(path, line, length, limits);
    const double fastest = (1.0 - kept_free) * along.speed;
    double ramp = (1.0 - kept_free) * along.acceleration;
    if (!(ramp > 0.0 && fastest > 0.0) || std::isinf(ramp)) return std::nullopt;
    if (fastest * fastest < (1.0 - kLeastStretch) * length * ramp) {
      const double ramp_s = fastest / ramp, ramp_way = 0.5 * fastest * ramp_s;
      const double stretch = length - 2.0 * ramp_way;
      writer.add(line, ramp_way, length, fastest, ramp_s);
      writer.add(line, ramp_way + stretch, length, fastest, stretch / fastest);
      writer.add(line, length, length, 0.0, ramp_s);
      continue;
    }
    ramp = std::min(ramp, fastest * fastest / length);
    const double ramp_s = std::sqrt(length / ramp);
    writer.add(line, 0.5 * length, length, ramp * ramp_s, ramp_s);
    writer.add(line, length, length, 0.0, ramp_s);
  }
  return writer.take();
}

}  // namespace sidestep::detail
