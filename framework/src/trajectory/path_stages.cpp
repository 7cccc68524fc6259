#ifndef SIDESTEP_KERNELS
#include "path_stages.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace sidestep::detail {
namespace {

struct CubicRates {
  double speed;   ///< |dq/ds|
  double change;  ///< d|dq/ds|^2 / ds / 2
  double bend;    ///< |d2q/ds2|
};

}  // namespace
}  // namespace sidestep::detail

#define SIDESTEP_KERNELS "path_stages.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep::detail {
namespace {

/// A stage whose direction turns by more than this is halved: cos 20 degrees.
constexpr double kLeastCosine = 0.94;
/// Unit vectors that differ by no more than this, by rounding, are one at any speed.
constexpr double kOneDirection = 1e-9;
/// Shares of the shorter side's way to its piece's other end, and of the path, that a stage around
/// a corner takes of each side: the shorter, the slower it must be.
constexpr double kAroundCorner = 1.0 / 3.0;
constexpr double kMostAroundCorner = 0.01;
/// Of a stage so little is not left beside one around a corner.
constexpr double kLeastLeft = 0.1;
/// Pieces that lead no farther in a row, as a share of the path, are left out.
constexpr double kLeastPiece = 1e-6;
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

/// |d3q/ds3|
double third_derivative(const CubicLanes& cubic) {
  const std::span c3(cubic.c3(), cubic.width);
  return 6.0 * std::sqrt(dot(c3, c3));
}

}  // namespace

PathStages::PathStages(const Trajectory& path, int least_stages)
    : path_(path), dof_(idx(path.dof)), width_(padded(dof_)) {
  const int pieces = path.size() - 1;
  if (pieces <= 0) return;
  cubics_.assign_zeros(idx(pieces) * CubicLanes::kRows * width_);
  for (int p = 0; p < pieces; ++p) length_ += take_piece(p, p);
  const int parts = std::max(4, (least_stages + pieces - 1) / pieces);
  const std::size_t expected = idx(parts) * idx(pieces) * 5 / 4;
  stages_.reserve(expected);
  rows_.reserve(expected * kRows * width_);
  double missing = 0.0;
  for (int p = 0, begin = 0; p < pieces; ++p) {
    const double length = take_piece(p, begin);
    const bool is_tiny = missing + length <= kLeastPiece * length_;
    const bool is_end = p == 0 || p + 1 == pieces;
    missing = is_tiny && !is_end ? missing + length : 0.0;
    if (is_tiny && !is_end) continue;  // the next one begins where this one would have
    begin = p + 1;
    cut_piece(p, is_tiny ? 1 : parts);
  }
  mark_stops();
  span_corners();
}

/// Writes the cubic of the piece that ends at the state after `piece`, with the position of `begin`
/// where it begins; returns its length.
double PathStages::take_piece(int piece, int begin) {
  const double h = path_.times_s[idx(piece) + 1] - path_.times_s[idx(piece)];
  const auto q0 = path_.q(begin), q1 = path_.q(piece + 1);
  const auto v0 = path_.qdot(piece), v1 = path_.qdot(piece + 1);
  double* rows = cubics_.data() + idx(piece) * CubicLanes::kRows * width_;
  for (std::size_t j = 0; j < dof_; ++j) {
    const double slope = (q1[j] - q0[j]) / h;
    rows[j] = q0[j];
    rows[width_ + j] = v0[j];
    rows[2 * width_ + j] = (3.0 * slope - 2.0 * v0[j] - v1[j]) / h;
    rows[3 * width_ + j] = (v0[j] + v1[j] - 2.0 * slope) / (h * h);
  }
  return SIDESTEP_DISPATCH(arc_length)(cubic(piece), 0.0, h);
}

void PathStages::position(int piece, double s, std::span<double> q) const {
  const CubicLanes c = cubic(piece);
  for (std::size_t j = 0; j < dof_; ++j) {
    q[j] = c.q0()[j] + s * (c.v0()[j] + s * (c.c2()[j] + s * c.c3()[j]));
  }
}

double PathStages::begin_s(int i) const {
  const Stage& stage = stages_[idx(i)];
  return path_.times_s[idx(stage.piece)] + stage.from_s;
}

double PathStages::length_of(const Stage& stage) const noexcept {
  if (!stage.is_corner)
    return SIDESTEP_DISPATCH(arc_length)(cubic(stage.piece), stage.from_s, stage.to_s);
  return SIDESTEP_DISPATCH(arc_length)(cubic(stage.piece), stage.from_s, stage.corner_s) +
         SIDESTEP_DISPATCH(arc_length)(cubic(stage.to_piece), behind_corner_s(stage), stage.to_s);
}

double PathStages::place_s(int piece, double from_s, double to_s, double way) const noexcept {
  const CubicLanes path = cubic(piece);
  double low = from_s, high = to_s;
  for (int halving = 0; halving < 50; ++halving) {
    const double middle = 0.5 * (low + high);
    (SIDESTEP_DISPATCH(arc_length)(path, from_s, middle) < way ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double PathStages::distance(int i, std::span<const double> q) const {
  const Stage& stage = stages_[idx(i)];
  if (!stage.is_corner) return distance(stage.piece, stage.from_s, stage.to_s, q);
  return std::min(distance(stage.piece, stage.from_s, stage.corner_s, q),
                  distance(stage.to_piece, behind_corner_s(stage), stage.to_s, q));
}

double PathStages::distance(int piece, double from_s, double to_s,
                            std::span<const double> q) const {
  const CubicLanes c = cubic(piece);
  double s = 0.5 * (from_s + to_s);
  double best = 0.0;
  constexpr int kSteps = 4;  // of Gauss-Newton, towards the nearest point
  for (int step = 0; step < kSteps; ++step) {
    double along = 0.0, speed = 0.0, worst = 0.0;
    for (std::size_t j = 0; j < dof_; ++j) {
      const double off = q[j] - (c.q0()[j] + s * (c.v0()[j] + s * (c.c2()[j] + s * c.c3()[j])));
      const double v = c.v0()[j] + s * (2.0 * c.c2()[j] + s * 3.0 * c.c3()[j]);
      along += off * v;
      speed += v * v;
      worst = std::max(worst, std::abs(off));
    }
    best = step == 0 ? worst : std::min(best, worst);
    if (speed == 0.0) break;
    const double next = std::clamp(s + along / speed, from_s, to_s);
    if (std::abs(next - s) <= 1e-4 * (to_s - from_s)) break;
    s = next;
  }
  return best;
}

void PathStages::derive_from(int stage) {
  derive(stages_[idx(stage)], false, &rows_[row_at(stage, 0)], &rows_[row_at(stage, 1)]);
}

void PathStages::derive_to(int stage) {
  derive(stages_[idx(stage)], true, &rows_[row_at(stage, 2)], &rows_[row_at(stage, 3)]);
}

void PathStages::derive(const Stage& stage, bool at_end, double* tangent, double* curvature) const {
  const double s = at_end ? stage.to_s : stage.from_s;
  const CubicLanes c = cubic(at_end ? stage.to_piece : stage.piece);
  const bool is_still = at_end ? stage.still_to : stage.still_from;
  if (!is_still && SIDESTEP_DISPATCH(rates_at)(c, s).speed > 0.0)
    return SIDESTEP_DISPATCH(derive_by_length)(c, s, tangent, curvature);
  // Leaving a standstill the path goes where its second derivative points, arriving at one it
  // comes from there; where that vanishes, too, both ways where the third one points.
  const std::span direction(tangent, dof_);
  std::fill_n(curvature, width_, 0.0);
  const double sign = at_end ? -1.0 : 1.0;
  for (std::size_t j = 0; j < dof_; ++j) {
    direction[j] = sign * (2.0 * c.c2()[j] + 6.0 * c.c3()[j] * s);
  }
  double norm = std::sqrt(dot(direction, direction));
  const double third = third_derivative(c);
  if (norm <= kStill * (stage.to_s - stage.from_s) * third) {
    for (std::size_t j = 0; j < dof_; ++j) direction[j] = 6.0 * c.c3()[j];
    norm = third;
  }
  for (double& value : direction) value /= norm > 0.0 ? norm : 1.0;
}

void PathStages::cut_piece(int piece, int parts) {
  const double h = path_.times_s[idx(piece) + 1] - path_.times_s[idx(piece)];
  const double step = h / parts;
  const CubicLanes path = cubic(piece);
  const double third = third_derivative(path);
  const auto is_still = [&](double s) {
    const CubicRates there = SIDESTEP_DISPATCH(rates_at)(path, s);
    return there.speed <= kStill * step * (there.bend + 0.5 * step * third);
  };
  double from = 0.0;
  bool from_still = is_still(0.0);
  const std::size_t first = stages_.size();
  const auto add = [&](double to) {
    const bool to_still = is_still(to);
    if (!(SIDESTEP_DISPATCH(arc_length)(path, from, to) > kLeastLength * length_)) {
      // Too little to be a stage: the next one begins here, or the one before ends later.
      if (to < h || stages_.size() == first) return;
      stages_.back().to_s = to;
      stages_.back().still_to = to_still;
      derive_to(size() - 1);
      return;
    }
    append({.piece = piece,
            .to_piece = piece,
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
    if (SIDESTEP_DISPATCH(rates_at)(path, from).change < 0.0 &&
        SIDESTEP_DISPATCH(rates_at)(path, to).change > 0.0) {
      double low = from, high = to;
      for (int halving = 0; halving < 50; ++halving) {
        const double middle = 0.5 * (low + high);
        (SIDESTEP_DISPATCH(rates_at)(path, middle).change < 0.0 ? low : high) = middle;
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

/// Takes a stage over with its rows.
void PathStages::push(const Stage& stage) {
  stages_.push_back(stage);
  rows_.resize(rows_.size() + kRows * width_);
  derive_from(size() - 1);
  derive_to(size() - 1);
  if (!stage.is_corner) return;
  const auto from = tangent_from(size() - 1), to = tangent_to(size() - 1);
  for (std::size_t j = 0; j < dof_; ++j) {
    const double turn = (to[j] - from[j]) / stage.length;
    rows_[row_at(size() - 1, 1) + j] = rows_[row_at(size() - 1, 3) + j] = turn;
  }
}

void PathStages::append(Stage stage, int depth) {
  stage.length = length_of(stage);
  push(stage);
  if (depth >= kMaxDepth || stage.length < kLeastHalved * length_ ||
      dot(tangent_from(size() - 1), tangent_to(size() - 1)) >= kLeastCosine) {
    return;
  }
  stages_.pop_back();
  rows_.resize(rows_.size() - kRows * width_);
  Stage first = stage, second = stage;
  first.to_s = second.from_s = 0.5 * (stage.from_s + stage.to_s);
  first.still_to = second.still_from = false;
  append(first, depth + 1);
  append(second, depth + 1);
}

void PathStages::mark_stops() {
  if (stages_.empty()) return;
  for (int i = 0; i + 1 < size(); ++i) {
    Stage& before = stages_[idx(i)];
    Stage& after = stages_[idx(i) + 1];
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
  ++version_;
  const std::vector<Stage> stages = std::exchange(stages_, {});
  const std::vector<double> rows = std::exchange(rows_, {});
  stages_.reserve(2 * stages.size());
  rows_.reserve(2 * rows.size());
  for (std::size_t i = 0; i < stages.size(); ++i) {
    if (!marks[i]) {
      stages_.push_back(stages[i]);
      const auto of_stage = std::span(rows).subspan(i * kRows * width_, kRows * width_);
      rows_.insert(rows_.end(), of_stage.begin(), of_stage.end());
      continue;
    }
    push_parts(stages[i]);
  }
}

void PathStages::push_parts(const Stage& stage) {
  Stage first = stage, last = stage, middle = stage;
  if (stage.is_corner) {
    const double behind_s = behind_corner_s(stage);
    const double before =
        SIDESTEP_DISPATCH(arc_length)(cubic(stage.piece), stage.from_s, stage.corner_s);
    const double behind =
        SIDESTEP_DISPATCH(arc_length)(cubic(stage.to_piece), behind_s, stage.to_s);
    const double way = 0.5 * std::min(before, behind);
    first.to_piece = stage.piece;
    last.piece = stage.to_piece;
    first.is_corner = last.is_corner = false;
    first.to_s = middle.from_s = place_s(stage.piece, stage.from_s, stage.corner_s, before - way);
    last.from_s = middle.to_s = place_s(stage.to_piece, behind_s, stage.to_s, way);
  } else {
    first.to_s = last.from_s = 0.5 * (stage.from_s + stage.to_s);
  }
  first.still_to = last.still_from = first.stop_to = last.stop_from = false;
  for (Stage* part : {&first, &middle, &last}) {
    if (part == &middle && !stage.is_corner) continue;
    part->length = length_of(*part);
    push(*part);
  }
}

bool PathStages::is_corner_behind(int i) const {
  if (i + 1 >= size() || stages_[idx(i)].stop_to) return false;
  double squares = 0.0;
  for (std::size_t j = 0; j < dof_; ++j) {
    const double turn = tangent_from(i + 1)[j] - tangent_to(i)[j];
    squares += turn * turn;
  }
  return squares > kOneDirection * kOneDirection;
}

/// What a stage around the corner behind each stage takes of both of its sides; 0 for no corner.
std::vector<double> PathStages::ways_around_corners() const {
  const std::size_t count = stages_.size();
  std::vector<char> is_corner(count);
  for (int i = 0; i < size(); ++i) is_corner[idx(i)] = is_corner_behind(i);
  // Before and behind each stage, itself included, within its piece and without a corner between.
  std::vector<double> before(count), behind(count);
  for (std::size_t i = 0; i < count; ++i) {
    const bool goes_on = i > 0 && !is_corner[i - 1] && stages_[i - 1].piece == stages_[i].piece;
    before[i] = stages_[i].length + (goes_on ? before[i - 1] : 0.0);
  }
  for (std::size_t i = count; i-- > 0;) {
    const bool goes_on = i + 1 < count && !is_corner[i] && stages_[i + 1].piece == stages_[i].piece;
    behind[i] = stages_[i].length + (goes_on ? behind[i + 1] : 0.0);
  }
  std::vector<double> ways(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_corner[i]) continue;
    ways[i] =
        std::min(kAroundCorner * std::min(before[i], behind[i + 1]), kMostAroundCorner * length_);
  }
  return ways;
}

/// What is left of a stage behind its first `before` and before its last `behind`; nothing where
/// that is hardly anything.
std::optional<PathStages::Stage> PathStages::rest_of(const Stage& stage, double before,
                                                     double behind) const {
  if (before <= 0.0 && behind <= 0.0) return stage;
  if (stage.length - before - behind <= kLeastLeft * stage.length) return std::nullopt;
  Stage rest = stage;
  if (before > 0.0) rest.from_s = place_s(stage.piece, stage.from_s, stage.to_s, before);
  if (behind > 0.0) {
    rest.to_s = place_s(stage.piece, stage.from_s, stage.to_s, stage.length - behind);
  }
  rest.length = length_of(rest);
  return rest;
}

/// Gives parts of the stages on both sides of each corner that is no stop to one around it.
void PathStages::span_corners() {
  const std::vector<double> ways = ways_around_corners();
  const std::size_t count = stages_.size();
  if (std::ranges::count(ways, 0.0) == std::ssize(ways)) return;
  std::vector<double> before(count), behind(count);  // that stages around corners take of each
  for (std::size_t corner = 0; corner < count; ++corner) {
    double left = ways[corner];
    for (std::size_t i = corner + 1; i-- > 0 && left > 0.0; left -= stages_[i].length) {
      behind[i] = left;
    }
    left = ways[corner];
    for (std::size_t i = corner + 1; i < count && left > 0.0; left -= stages_[i++].length) {
      before[i] = left;
    }
  }
  const std::vector<Stage> stages = std::exchange(stages_, {});
  rows_.clear();
  std::optional<Stage> around;
  for (std::size_t i = 0; i < count; ++i) {
    const auto rest = rest_of(stages[i], before[i], behind[i]);
    if (rest && around) {
      around->from_s = stages_.back().to_s;
      around->to_piece = rest->piece;
      around->to_s = rest->from_s;
      around->length = length_of(*around);
      push(*around);
      around.reset();
    }
    if (rest) push(*rest);
    if (ways[i] == 0.0) continue;
    around = Stage{.piece = stages[i].piece, .is_corner = true, .corner_s = stages[i].to_s};
  }
}

}  // namespace sidestep::detail

#else

namespace {

using namespace detail;

/// dq/ds of the joints from j on.
SIDESTEP_INLINE void find_velocity(const CubicLanes& cubic, std::size_t j, double s,
                                   Lanes& v) noexcept {
  v = lanes(cubic.v0() + j) + s * (2.0 * lanes(cubic.c2() + j) + 3.0 * s * lanes(cubic.c3() + j));
}

/// d2q/ds2 of them.
SIDESTEP_INLINE void find_acceleration(const CubicLanes& cubic, std::size_t j, double s,
                                       Lanes& a) noexcept {
  a = 2.0 * lanes(cubic.c2() + j) + 6.0 * s * lanes(cubic.c3() + j);
}

CubicRates rates_at(const CubicLanes& cubic, double s) noexcept {
  Lanes speed{}, change{}, bend{};
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    speed += v * v;
    change += v * a;
    bend += a * a;
  }
  return {__builtin_sqrt(sum_of(speed)), sum_of(change), __builtin_sqrt(sum_of(bend))};
}

/// By Gauss and Legendre's rule of five points.
double arc_length(const CubicLanes& cubic, double from_s, double to_s) noexcept {
  constexpr std::array kNodes{-0.9061798459386640, -0.5384693101056831, 0.0, 0.5384693101056831,
                              0.9061798459386640};
  constexpr std::array kWeights{0.2369268850561891, 0.4786286704993665, 0.5688888888888889,
                                0.4786286704993665, 0.2369268850561891};
  const double middle = 0.5 * (from_s + to_s), half = 0.5 * (to_s - from_s);
  double sum = 0.0;
  for (std::size_t k = 0; k < kNodes.size(); ++k) {
    const double s = middle + half * kNodes[k];
    Lanes squares{};
    for (std::size_t j = 0; j < cubic.width; j += kLanes) {
      Lanes v;
      find_velocity(cubic, j, s, v);
      squares += v * v;
    }
    sum += kWeights[k] * __builtin_sqrt(sum_of(squares));
  }
  return half * sum;
}

/// dq/dl and d2q/dl2, rows of joints, where the speed is not 0.
void derive_by_length(const CubicLanes& cubic, double s, double* tangent,
                      double* curvature) noexcept {
  Lanes squares{}, products{};
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    squares += v * v;
    products += v * a;
  }
  const double per_square = 1.0 / sum_of(squares), per_speed = __builtin_sqrt(per_square);
  const double along = sum_of(products) * per_square;  // of the acceleration, in velocities
  for (std::size_t j = 0; j < cubic.width; j += kLanes) {
    Lanes v, a;
    find_velocity(cubic, j, s, v);
    find_acceleration(cubic, j, s, a);
    lanes(tangent + j) = v * per_speed;
    lanes(curvature + j) = (a - along * v) * per_square;
  }
}

}  // namespace

#endif
