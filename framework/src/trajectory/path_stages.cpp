#include "path_stages.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace sidestep::detail {
namespace {

/// A stage whose direction turns by more than this is halved: cos 20 degrees.
constexpr double kLeastCosine = 0.94;
/// Directions that agree this well are one: cos 1 degree.
constexpr double kSameDirection = 0.9998;
constexpr int kMaxDepth = 14;
/// The path stands still where it is slower than this share of the speed that it gains within one
/// stage: what it does there is finer than the stage by that share squared.
constexpr double kStill = 1e-3;
/// The slowest point this near an end, as a share of a stage, where the path stands still, is it.
constexpr double kSamePlace = 0.05;
constexpr double kLeastPart = 1e-6;
/// Stages shorter than this share of the path are none, and those shorter than that are not halved.
constexpr double kLeastLength = 1e-12;
constexpr double kLeastHalved = 1e-9;

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

}  // namespace

PathStages::PathStages(const Trajectory& path, int least_stages)
    : path_(path), dof_(static_cast<std::size_t>(path.dof)) {
  const int pieces = path.size() - 1;
  cubics_.reserve(at(std::max(pieces, 0)) * dof_);
  for (int p = 0; p < pieces; ++p) {
    const double h = path.times_s[at(p) + 1] - path.times_s[at(p)];
    const auto q0 = path.q(p), q1 = path.q(p + 1), v0 = path.qdot(p), v1 = path.qdot(p + 1);
    for (std::size_t j = 0; j < dof_; ++j) {
      const double slope = (q1[j] - q0[j]) / h;
      cubics_.push_back({q0[j], v0[j], (3.0 * slope - 2.0 * v0[j] - v1[j]) / h,
                         (v0[j] + v1[j] - 2.0 * slope) / (h * h)});
    }
  }
  for (int p = 0; p < pieces; ++p) {
    length_ += arc_length(p, 0.0, path.times_s[at(p) + 1] - path.times_s[at(p)]);
  }
  if (pieces == 0) return;
  ends_.resize(4 * dof_);
  const int parts = std::max(4, (least_stages + pieces - 1) / pieces);
  stages_.reserve(2 * at(parts) * at(pieces));
  for (int p = 0; p < pieces; ++p) cut_piece(p, parts);
  derive_all();
  mark_stops();
}

PathStages::Rates PathStages::rates(int piece, double s) const {
  double speed = 0.0, change = 0.0, bend = 0.0;
  for (const Cubic& c : joints(piece)) {
    const double v = c.v0 + s * (2.0 * c.c2 + s * 3.0 * c.c3);
    const double a = 2.0 * c.c2 + s * 6.0 * c.c3;
    speed += v * v;
    change += v * a;
    bend += a * a;
  }
  return {std::sqrt(speed), change, std::sqrt(bend)};
}

double PathStages::arc_length(int piece, double from_s, double to_s) const {
  // Gauss-Legendre, five points.
  constexpr std::array kNodes{0.0, 0.5384693101056831, 0.9061798459386640};
  constexpr std::array kWeights{0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
  const double middle = 0.5 * (from_s + to_s), half = 0.5 * (to_s - from_s);
  double sum = kWeights[0] * rates(piece, middle).speed;
  for (std::size_t k = 1; k < kNodes.size(); ++k) {
    sum += kWeights[k] * (rates(piece, middle - half * kNodes[k]).speed +
                          rates(piece, middle + half * kNodes[k]).speed);
  }
  return half * sum;
}

void PathStages::position(int piece, double s, std::span<double> q) const {
  const auto cubics = joints(piece);
  for (std::size_t j = 0; j < dof_; ++j) {
    const Cubic& c = cubics[j];
    q[j] = c.q0 + s * (c.v0 + s * (c.c2 + s * c.c3));
  }
}

double PathStages::begin_s(int i) const {
  const Stage& stage = stages_[at(i)];
  return path_.times_s[at(stage.piece)] + stage.from_s;
}

double PathStages::distance(int i, std::span<const double> q) const {
  const Stage& stage = stages_[at(i)];
  const auto cubics = joints(stage.piece);
  double s = 0.5 * (stage.from_s + stage.to_s);
  double best = 0.0;
  constexpr int kSteps = 4;  // of Gauss-Newton, towards the nearest point
  for (int step = 0; step < kSteps; ++step) {
    double along = 0.0, speed = 0.0, worst = 0.0;
    for (std::size_t j = 0; j < dof_; ++j) {
      const Cubic& c = cubics[j];
      const double off = q[j] - (c.q0 + s * (c.v0 + s * (c.c2 + s * c.c3)));
      const double v = c.v0 + s * (2.0 * c.c2 + s * 3.0 * c.c3);
      along += off * v;
      speed += v * v;
      worst = std::max(worst, std::abs(off));
    }
    best = step == 0 ? worst : std::min(best, worst);
    if (speed == 0.0) break;
    const double next = std::clamp(s + along / speed, stage.from_s, stage.to_s);
    if (std::abs(next - s) <= 1e-4 * (stage.to_s - stage.from_s)) break;
    s = next;
  }
  return best;
}

void PathStages::derive(const Stage& stage, bool at_end, std::span<double> tangent,
                        std::span<double> curvature) const {
  const double s = at_end ? stage.to_s : stage.from_s;
  const auto cubics = joints(stage.piece);
  std::ranges::fill(curvature, 0.0);
  if ((at_end ? stage.still_to : stage.still_from) || rates(stage.piece, s).speed == 0.0) {
    // Leaving a standstill the path goes where its second derivative points, arriving at one it
    // comes from there; where that vanishes, too, both ways where the third one points.
    const double sign = at_end ? -1.0 : 1.0;
    for (std::size_t j = 0; j < dof_; ++j) {
      tangent[j] = sign * (2.0 * cubics[j].c2 + 6.0 * cubics[j].c3 * s);
    }
    double norm = std::sqrt(dot(tangent, tangent));
    const double reach = stage.to_s - stage.from_s;
    double third = 0.0;
    for (const Cubic& c : cubics) third += 36.0 * c.c3 * c.c3;
    if (norm <= kStill * reach * std::sqrt(third)) {
      for (std::size_t j = 0; j < dof_; ++j) tangent[j] = 6.0 * cubics[j].c3;
      norm = std::sqrt(third);
    }
    for (double& value : tangent) value /= norm > 0.0 ? norm : 1.0;
    return;
  }
  for (std::size_t j = 0; j < dof_; ++j) {
    tangent[j] = cubics[j].v0 + s * (2.0 * cubics[j].c2 + s * 3.0 * cubics[j].c3);
    curvature[j] = 2.0 * cubics[j].c2 + s * 6.0 * cubics[j].c3;
  }
  const double speed = std::sqrt(dot(tangent, tangent));
  for (double& value : tangent) value /= speed;
  const double along = dot(tangent, curvature);
  for (std::size_t j = 0; j < dof_; ++j) {
    curvature[j] = (curvature[j] - along * tangent[j]) / (speed * speed);
  }
}

void PathStages::cut_piece(int piece, int parts) {
  const double h = path_.times_s[at(piece) + 1] - path_.times_s[at(piece)];
  const double step = h / parts;
  const double third = [&] {
    double sum = 0.0;
    for (const Cubic& c : joints(piece)) sum += 36.0 * c.c3 * c.c3;
    return std::sqrt(sum);
  }();
  const auto is_still = [&](double s) {
    const Rates there = rates(piece, s);
    return there.speed <= kStill * step * (there.bend + 0.5 * step * third);
  };
  double from = 0.0;
  bool from_still = is_still(0.0);
  const std::size_t first = stages_.size();
  const auto add = [&](double to) {
    const bool to_still = is_still(to);
    if (!(arc_length(piece, from, to) > kLeastLength * length_)) {
      // Too little to be a stage: the next one begins here, or the one before ends later.
      if (to < h || stages_.size() == first) return;
      stages_.back().to_s = to;
      stages_.back().still_to = to_still;
      return;
    }
    append({.piece = piece,
            .from_s = from,
            .to_s = to,
            .still_from = from_still,
            .still_to = to_still},
           0);
    from = to;
    from_still = to_still;
  };
  for (int k = 0; k < parts; ++k) {
    const double to = k + 1 == parts ? h : (k + 1) * step;
    // Where the path is slowest it turns fastest: never inside a stage.
    if (rates(piece, from).change < 0.0 && rates(piece, to).change > 0.0) {
      double low = from, high = to;
      for (int halving = 0; halving < 50; ++halving) {
        const double middle = 0.5 * (low + high);
        (rates(piece, middle).change < 0.0 ? low : high) = middle;
      }
      const double slowest = 0.5 * (low + high);
      // A standstill at an end is that very place.
      const double near_from = (from_still ? kSamePlace : kLeastPart) * step;
      const double near_to = (is_still(to) ? kSamePlace : kLeastPart) * step;
      if (slowest - from > near_from && to - slowest > near_to) add(slowest);
    }
    add(to);
  }
}

void PathStages::append(Stage stage, int depth) {
  stage.length = arc_length(stage.piece, stage.from_s, stage.to_s);
  const auto part = [&](std::size_t k) { return std::span(ends_).subspan(k * dof_, dof_); };
  derive(stage, false, part(0), part(1));
  derive(stage, true, part(2), part(3));
  if (depth >= kMaxDepth || stage.length < kLeastHalved * length_ ||
      dot(part(0), part(2)) >= kLeastCosine) {
    stages_.push_back(stage);
    return;
  }
  Stage first = stage, second = stage;
  first.to_s = second.from_s = 0.5 * (stage.from_s + stage.to_s);
  first.still_to = second.still_from = false;
  append(first, depth + 1);
  append(second, depth + 1);
}

void PathStages::derive_all() {
  rows_.resize(stages_.size() * 4 * dof_);
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    const auto part = [&](std::size_t k) {
      return std::span(rows_).subspan((i * 4 + k) * dof_, dof_);
    };
    derive(stages_[i], false, part(0), part(1));
    derive(stages_[i], true, part(2), part(3));
  }
}

void PathStages::mark_stops() {
  if (stages_.empty()) return;
  for (int i = 0; i + 1 < size(); ++i) {
    Stage& before = stages_[at(i)];
    Stage& after = stages_[at(i) + 1];
    // What one side calls a standstill is none where both go on in the same direction.
    const bool turns = dot(tangent_to(i), tangent_from(i + 1)) < kSameDirection;
    before.stop_to = after.stop_from = turns;
  }
  stages_.front().stop_from = stages_.front().still_from;
  stages_.back().stop_to = stages_.back().still_to;
  std::vector<char> marks(stages_.size());
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    marks[i] = stages_[i].stop_from && stages_[i].stop_to;  // it could not move at all
  }
  if (std::ranges::count(marks, 1) > 0) halve(marks);
}

void PathStages::halve(const std::vector<char>& marks) {
  std::vector<Stage> stages;
  stages.reserve(2 * stages_.size());
  for (std::size_t i = 0; i < stages_.size(); ++i) {
    if (!marks[i]) {
      stages.push_back(stages_[i]);
      continue;
    }
    Stage first = stages_[i], second = stages_[i];
    first.to_s = second.from_s = 0.5 * (first.from_s + first.to_s);
    first.still_to = second.still_from = first.stop_to = second.stop_from = false;
    first.length = arc_length(first.piece, first.from_s, first.to_s);
    second.length = arc_length(second.piece, second.from_s, second.to_s);
    stages.push_back(first);
    stages.push_back(second);
  }
  stages_ = std::move(stages);
  derive_all();
}

}  // namespace sidestep::detail
