#ifndef SIDESTEP_KERNELS
#include "edge_prover.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <sidestep/core/index.hpp>

#define SIDESTEP_KERNELS "edge_prover.cpp"
#include <sidestep/core/each_target.hpp>

namespace sidestep {
namespace {

constexpr double kEndless_m = 1e30;
constexpr std::size_t kFirstParts = kLanes;
constexpr std::size_t kSplit = 4;  ///< find_ways() counts on neighbours in fours.
/// More open parts than this are not worth cutting: the edge is absurd.
constexpr std::size_t kMostEdgeParts = std::size_t{1} << 16;

std::uint64_t bit_of(std::size_t number) { return std::uint64_t{1} << (number % 64); }

unsigned bits_of(const double (&is_set)[kLanes]) {
  unsigned bits = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    if (is_set[lane] != 0.0) bits |= 1u << lane;
  }
  return bits;
}

Eigen::Vector3d point(const PointLanes& points_m, std::size_t lane) {
  return {points_m.x[lane], points_m.y[lane], points_m.z[lane]};
}

}  // namespace

struct EdgeProver::Look {
  std::span<const Part> parts;
  double half;  ///< Of a part.
  double resolution_m;
  std::uint64_t balls[kLanes] = {};  ///< Not shown clear.
  std::uint64_t pairs[kLanes] = {};
};

EdgeProver::EdgeProver(std::shared_ptr<const RobotModel> robot,
                       std::shared_ptr<const MotionBounds> bounds)
    : robot_(std::move(robot)),
      above_floor_(space_, robot_->description()),
      bounds_(std::move(bounds)),
      variation_(robot_->description().joints.size()),
      q_(kLanes * variation_.size()),
      centres_(robot_->description().spheres.size()) {
  const RobotDescription& robot_is = robot_->description();
  std::vector<std::size_t> ball_of_link(robot_is.links.size(), robot_is.links.size());
  for (int s = 0; s < static_cast<int>(robot_is.spheres.size()); ++s) {
    const CollisionSphere& sphere = robot_is.spheres[idx(s)];
    radius_m_.push_back(sphere.radius_m);
    std::size_t& ball = ball_of_link[idx(sphere.link)];
    if (ball == robot_is.links.size()) {
      ball = balls_.size();
      balls_.push_back({.link = sphere.link, .radius_m = kInfinity});
    }
    balls_[ball].spheres.push_back(s);
  }
  const auto centre_m = [&](int s) -> const Eigen::Vector3d& {
    return robot_is.spheres[idx(s)].centre_link_m;
  };
  for (Ball& ball : balls_) {
    ball.outermost =
        *std::ranges::max_element(ball.spheres, {}, [&](int s) { return centre_m(s).norm(); });
    for (const int middle : ball.spheres) {
      double radius_m = 0.0;
      for (const int s : ball.spheres) {
        radius_m = std::max(radius_m, (centre_m(s) - centre_m(middle)).norm() + radius_m_[idx(s)]);
      }
      if (radius_m >= ball.radius_m) continue;
      ball.radius_m = radius_m;
      ball.centre = middle;
    }
  }
  for (std::size_t pair = 0; pair < robot_is.self_collision_pairs.size(); ++pair) {
    const auto [first, second] = robot_is.self_collision_pairs[pair];
    const std::size_t a = ball_of_link[idx(first)], b = ball_of_link[idx(second)];
    if (std::max(a, b) == robot_is.links.size()) continue;  // one has no spheres
    pairs_.push_back({a, b, static_cast<int>(pair)});
  }
  robot_->sphere_centre_lanes(std::span(q_).first(variation_.size()), centres_, scratch_);  // warm
  order_.resize(balls_.size());
  std::iota(order_.rbegin(), order_.rend(),
            std::size_t{0});  // what moves most is likeliest to touch
  ball_bend_m_.resize(balls_.size());
  ways_m_.assign_zeros(balls_.size() + pairs_.size());
  levers_.assign_zeros(ways_m_.size() * variation_.size());
  for (std::size_t row = 0; row < balls_.size() + pairs_.size(); ++row) {
    const auto levers = row < balls_.size()
                            ? bounds_->sphere_levers(balls_[row].outermost)
                            : bounds_->pair_levers(pairs_[row - balls_.size()].pair);
    for (std::size_t j = 0; j < levers.size(); ++j) {
      // Of an unlimited slide before a turning joint it is infinite: of no use to an edge, and not
      // to become a number where that joint rests.
      levers_.data()[j * ways_m_.size() + row] = std::min(levers[j], kEndless_m);
    }
  }
}

void EdgeProver::look_at(std::shared_ptr<const SceneField> field, const SpacePolicy& space,
                         double margin_m) {
  field_ = std::move(field);
  space_ = space;
  above_floor_ = FloorClearance(space_, robot_->description());
  is_bounded_ = space_.floor.has_value() || space_.outside == Space::kOccupied;
  margin_m_ = margin_m;
  shapes_.resize(field_->shapes().size());
  nearer_.resize(field_->shapes().size());
}

bool EdgeProver::is_clear(std::span<const double> q) { return is_clear(q, q, kInfinity, 0.0); }

bool EdgeProver::is_clear(std::span<const double> q_from, std::span<const double> q_to,
                          double resolution_m, double spare_m) {
  const auto is_finite = [](double value) { return std::isfinite(value); };
  if (!std::ranges::all_of(q_from, is_finite) || !std::ranges::all_of(q_to, is_finite)) {
    return false;
  }
  q_from_ = q_from;
  q_to_ = q_to;
  spare_m_ = spare_m;
  measure_edge();
  return prove(resolution_m);
}

unsigned EdgeProver::find_blocked(std::span<const double> q) {
  const unsigned all = (1u << (q.size() / variation_.size())) - 1u;
  unsigned open = all;
  spare_m_ = 0.0;
  robot_->sphere_centre_lanes(q, centres_, scratch_);
  for (std::size_t i = 0; i < balls_.size() && open != 0; ++i) {
    const std::size_t ball = order_[i];
    const unsigned blocked = find_blocked(ball, open);
    if (blocked == 0) continue;
    open &= ~blocked;
    std::rotate(order_.begin(), order_.begin() + i, order_.begin() + i + 1);
  }
  for (std::size_t pair = 0; pair < pairs_.size() && open != 0; ++pair) {
    open &= ~find_touching(pair, open);
  }
  return all & ~open;
}

/// Which of the open lanes have a sphere of a ball in the way.
unsigned EdgeProver::find_blocked(std::size_t number, unsigned open) {
  Ball& ball = balls_[number];
  alignas(64) double limits_m[kLanes], is_hit[kLanes] = {};
  std::ranges::fill(limits_m, ball.radius_m + margin_m_);
  const std::size_t near = field_->find_within(field_->shapes(), centres_[idx(ball.centre)],
                                               limits_m, shapes_.data(), is_hit);
  unsigned close = bits_of(is_hit);
  for (std::size_t lane = 0; is_bounded_ && lane < kLanes; ++lane) {
    if ((open & ~close) >> lane & 1u && !is_well_inside(ball, lane, 0.0)) close |= 1u << lane;
  }
  open &= close;
  if (open == 0) return 0;
  std::ranges::fill(is_hit, 0.0);
  unsigned blocked = 0;
  for (int& sphere : ball.spheres) {
    const PointLanes& centre_m = centres_[idx(sphere)];
    std::ranges::fill(limits_m, radius_m_[idx(sphere)] + margin_m_);
    (void)field_->find_within(std::span(shapes_).first(near), centre_m, limits_m, nearer_.data(),
                              is_hit);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      if ((open >> lane & 1u) == 0) continue;
      bool is_blocked = is_hit[lane] != 0.0;
      is_hit[lane] = 0.0;
      if (is_bounded_ || is_blocked) {
        const Eigen::Vector3d p_m = point(centre_m, lane);
        const double inside_m = field_->info().grid.inside_m(p_m);
        if (space_.outside == Space::kFree && inside_m < 0.0) is_blocked = false;
        is_blocked |= above_floor_(idx(sphere), p_m) < margin_m_ ||
                      (space_.outside == Space::kOccupied && inside_m < 0.0);
      }
      if (is_blocked) blocked |= 1u << lane;
    }
    if ((open & ~blocked) == 0) {
      std::swap(sphere, ball.spheres.front());
      break;
    }
  }
  return blocked;
}

unsigned EdgeProver::find_touching(std::size_t number, unsigned open) const {
  const BallPair& pair = pairs_[number];
  const Ball &first = balls_[pair.a], &second = balls_[pair.b];
  alignas(64) double is_hit[kLanes] = {};
  const PointLanes& middle_m = centres_[idx(second.centre)];
  if (!SIDESTEP_DISPATCH(find_close)(centres_[idx(first.centre)], middle_m,
                                     first.radius_m + second.radius_m, is_hit)) {
    return 0;
  }
  open &= bits_of(is_hit);
  std::ranges::fill(is_hit, 0.0);
  for (const int a : first.spheres) {
    if ((open & ~bits_of(is_hit)) == 0) break;
    const double a_m = radius_m_[idx(a)];
    alignas(64) double ignored[kLanes] = {};
    if (!SIDESTEP_DISPATCH(find_close)(centres_[idx(a)], middle_m, a_m + second.radius_m,
                                       ignored)) {
      continue;
    }
    for (const int b : second.spheres) {
      (void)SIDESTEP_DISPATCH(find_close)(centres_[idx(a)], centres_[idx(b)],
                                          a_m + radius_m_[idx(b)], is_hit);
    }
  }
  return open & bits_of(is_hit);
}

void EdgeProver::measure_edge() {
  SIDESTEP_DISPATCH(find_products)
  (levers_.data(), ways_m_.size(), variation_.size(), q_from_.data(), q_to_.data(), ways_m_.data());
  for (std::size_t j = 0; j < variation_.size(); ++j) {
    variation_[j] = std::abs(q_to_[j] - q_from_[j]);
  }
  std::ranges::fill(ball_bend_m_, -1.0);
}

double EdgeProver::ball_bend_m(std::size_t ball) {
  double& bend_m = ball_bend_m_[ball];
  if (bend_m < 0.0) bend_m = bounds_->bend(balls_[ball].outermost, variation_);
  return bend_m;
}

bool EdgeProver::prove(double resolution_m) {
  double half = 0.5 / kFirstParts;
  parts_.clear();
  for (std::size_t i = 0; i < kFirstParts; ++i) {
    parts_.push_back({static_cast<double>(2 * i + 1) * half, ~std::uint64_t{0}, ~std::uint64_t{0}});
  }
  while (true) {
    next_.clear();
    for (std::size_t first = 0; first < parts_.size(); first += kLanes) {
      const std::size_t count = std::min(kLanes, parts_.size() - first);
      if (!look(std::span(parts_).subspan(first, count), half, resolution_m)) return false;
    }
    if (next_.empty()) return true;
    if (next_.size() > kMostEdgeParts) return false;
    half /= kSplit;
    parts_.clear();
    for (const Part& part : next_) {
      for (std::size_t i = 0; i < kSplit; ++i) {
        const double shift = static_cast<double>(2 * i + 1) - static_cast<double>(kSplit);
        parts_.push_back({part.middle + shift * half, part.balls, part.pairs});
      }
    }
  }
}

/// Looks at kLanes parts at most, and leaves those that must be cut in next_; false where one is
/// not clear, or cannot be shown clear.
bool EdgeProver::look(std::span<const Part> parts, double half, double resolution_m) {
  const std::size_t dof = variation_.size();
  Look look{.parts = parts, .half = half, .resolution_m = resolution_m};
  std::uint64_t balls = 0, pairs = 0;
  for (std::size_t lane = 0; lane < parts.size(); ++lane) {
    balls |= parts[lane].balls;
    pairs |= parts[lane].pairs;
    for (std::size_t j = 0; j < dof; ++j) {
      q_[lane * dof + j] = q_from_[j] + parts[lane].middle * (q_to_[j] - q_from_[j]);
    }
  }
  robot_->sphere_centre_lanes(std::span(q_).first(parts.size() * dof), centres_, scratch_);
  for (std::size_t i = 0; i < balls_.size(); ++i) {
    const std::size_t ball = order_[i];
    if ((balls & bit_of(ball)) == 0 || look_at_ball(ball, look)) continue;
    std::rotate(order_.begin(), order_.begin() + i, order_.begin() + i + 1);
    return false;
  }
  for (std::size_t pair = 0; pair < pairs_.size(); ++pair) {
    if ((pairs & bit_of(pair)) != 0 && !look_at_pair(pair, look)) return false;
  }
  for (std::size_t lane = 0; lane < parts.size(); ++lane) {
    if ((look.balls[lane] | look.pairs[lane]) == 0) continue;
    next_.push_back({parts[lane].middle, look.balls[lane], look.pairs[lane]});
  }
  return true;
}

bool EdgeProver::look_at_ball(std::size_t number, Look& look) {
  Ball& ball = balls_[number];
  alignas(64) double limits_m[kLanes], is_near[kLanes] = {};
  std::ranges::fill(limits_m,
                    ball.radius_m + margin_m_ + spare_m_ + ball_way_m(number) * look.half);
  const PointLanes& centre_m = centres_[idx(ball.centre)];
  const std::size_t near =
      field_->find_within(field_->shapes(), centre_m, limits_m, shapes_.data(), is_near);
  const double way_m = ball_way_m(number) * look.half + spare_m_;
  bool is_on_edge = false;
  for (std::size_t lane = 0; is_bounded_ && !is_on_edge && lane < look.parts.size(); ++lane) {
    is_on_edge = !is_well_inside(ball, lane, way_m);
  }
  if (near == 0 && !is_on_edge) return true;
  for (int& sphere : ball.spheres) {
    if (look_at_sphere(number, sphere, std::span(shapes_).first(near), look)) continue;
    std::swap(sphere, ball.spheres.front());
    return false;
  }
  return true;
}

/// Whether the whole ball keeps away from the floor and the field's bounds, as far as they matter.
bool EdgeProver::is_well_inside(const Ball& ball, std::size_t lane, double way_m) const {
  const Eigen::Vector3d p_m = point(centres_[idx(ball.centre)], lane);
  const double beyond_m = ball.radius_m - radius_m_[idx(ball.centre)];
  if (above_floor_(idx(ball.centre), p_m) - beyond_m - way_m < margin_m_) return false;
  return space_.outside == Space::kFree ||
         field_->info().grid.inside_m(p_m) >= ball.radius_m + way_m;
}

bool EdgeProver::look_at_sphere(std::size_t number, int sphere,
                                std::span<const std::uint32_t> shapes, Look& look) {
  const PointLanes& centre_m = centres_[idx(sphere)];
  const double required_m = radius_m_[idx(sphere)] + margin_m_ + spare_m_;
  alignas(64) double ways_m[kLanes], limits_m[kLanes], is_near[kLanes] = {}, is_hit[kLanes] = {};
  SIDESTEP_DISPATCH(find_ways)
  (centre_m, ball_way_m(number) * look.half, 1.5 * ball_bend_m(number) * look.half * look.half,
   ways_m);
  SIDESTEP_DISPATCH(add_to)(ways_m, required_m, limits_m);
  const std::size_t near = field_->find_within(shapes, centre_m, limits_m, nearer_.data(), is_near);
  if (near == 0 && !is_bounded_) return true;
  std::ranges::fill(limits_m, required_m);
  (void)field_->find_within(std::span(nearer_).first(near), centre_m, limits_m, nearer_.data(),
                            is_hit);
  for (std::size_t lane = 0; lane < look.parts.size(); ++lane) {
    if ((look.parts[lane].balls & bit_of(number)) == 0) continue;
    const Eigen::Vector3d p_m = point(centre_m, lane);
    const double inside_m = field_->info().grid.inside_m(p_m);
    const double above_m = above_floor_(idx(sphere), p_m) - spare_m_;
    const bool is_outside_free = space_.outside == Space::kFree && inside_m < 0.0;
    if (is_hit[lane] != 0.0 && !is_outside_free) return false;
    if (above_m < margin_m_ || (space_.outside == Space::kOccupied && inside_m < spare_m_))
      return false;
    const bool is_away = is_outside_free && -inside_m >= ways_m[lane] + spare_m_;  // never inside
    const bool is_open = (is_near[lane] != 0.0 && !is_away) || above_m - ways_m[lane] < margin_m_ ||
                         (space_.outside == Space::kOccupied && inside_m < ways_m[lane] + spare_m_);
    if (!is_open) continue;
    if (2.0 * ways_m[lane] <= look.resolution_m) return false;
    look.balls[lane] |= bit_of(number);
  }
  return true;
}

bool EdgeProver::look_at_pair(std::size_t number, Look& look) const {
  const BallPair& pair = pairs_[number];
  const Ball &first = balls_[pair.a], &second = balls_[pair.b];
  const double way_m = pair_way_m(number) * look.half + spare_m_;
  alignas(64) double ignored[kLanes] = {}, is_near[kLanes] = {}, is_hit[kLanes] = {};
  const PointLanes& middle_m = centres_[idx(second.centre)];
  if (!SIDESTEP_DISPATCH(find_close)(centres_[idx(first.centre)], middle_m,
                                     first.radius_m + second.radius_m + way_m, ignored)) {
    return true;
  }
  for (const int a : first.spheres) {
    const double a_m = radius_m_[idx(a)];
    if (!SIDESTEP_DISPATCH(find_close)(centres_[idx(a)], middle_m, a_m + second.radius_m + way_m,
                                       ignored)) {
      continue;
    }
    for (const int b : second.spheres) {
      const double sum_m = a_m + radius_m_[idx(b)];
      if (!SIDESTEP_DISPATCH(find_close)(centres_[idx(a)], centres_[idx(b)], sum_m + way_m,
                                         is_near))
        continue;
      (void)SIDESTEP_DISPATCH(find_close)(centres_[idx(a)], centres_[idx(b)], sum_m, is_hit);
    }
  }
  for (std::size_t lane = 0; lane < look.parts.size(); ++lane) {
    if ((look.parts[lane].pairs & bit_of(number)) == 0 || is_near[lane] == 0.0) continue;
    if (is_hit[lane] != 0.0 || 2.0 * (way_m - spare_m_) <= look.resolution_m) return false;
    look.pairs[lane] |= bit_of(number);
  }
  return true;
}

}  // namespace sidestep

#else

namespace {

/// Steps from each lane to the next of its four; the fourth's is the third's.
SIDESTEP_INLINE void add_steps(const double* from, double* squares) noexcept {
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const std::size_t first = lane - (lane % 4 == 3 ? 1 : 0);
    const double step = from[first + 1] - from[first];
    squares[lane] += step * step;
  }
}

/// How far a point comes from where it is in each lane, within half a part of an edge before or
/// after it. Lanes are the middles of parts that follow each other, 0 to 3 and 4 to 7 alike: the
/// chord to the next lane is the mean of the velocity between the two, so that the way is at most
/// half the chord and `bent_m` (3/2 of the greatest acceleration times the half part's square), nor
/// more than `widest_m`.
void find_ways(const PointLanes& points_m, double widest_m, double bent_m,
               double* ways_m) noexcept {
  alignas(64) double squares[kLanes] = {};
  add_steps(points_m.x, squares);
  add_steps(points_m.y, squares);
  add_steps(points_m.z, squares);
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    ways_m[lane] = lesser(widest_m, 0.5 * __builtin_sqrt(squares[lane]) + bent_m);
  }
}

/// Whether two points are nearer than a limit in any lane; is_near[lane] becomes 1 there and is
/// left alone elsewhere.
bool find_close(const PointLanes& a_m, const PointLanes& b_m, double limit_m,
                double* is_near) noexcept {
  const Lanes x = lanes(a_m.x) - lanes(b_m.x), y = lanes(a_m.y) - lanes(b_m.y),
              z = lanes(a_m.z) - lanes(b_m.z);
  const Lanes close = ones_where(x * x + y * y + z * z < limit_m * limit_m);
  lanes(is_near) = greater(close, lanes(is_near));
  return any_of(close);
}

/// ways[row] = sum over columns of |to - from| * table[column * stride + row]; `stride` rows, whole
/// lanes.
void find_products(const double* table, std::size_t stride, std::size_t columns, const double* from,
                   const double* to, double* ways) noexcept {
  for (std::size_t row = 0; row < stride; row += kLanes) {
    Lanes sum{};
    for (std::size_t column = 0; column < columns; ++column) {
      sum += __builtin_fabs(to[column] - from[column]) * lanes(table + column * stride + row);
    }
    lanes(ways + row) = sum;
  }
}

/// sums = values + addend.
void add_to(const double* values, double addend, double* sums) noexcept {
  lanes(sums) = lanes(values) + addend;
}

}  // namespace

#endif
