#include "base_clearance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/costs.hpp>

namespace sidestep::detail {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kApart_s = 0.05;  ///< Between the instants at which spheres are placed.

}  // namespace

OtherJoints::OtherJoints(const Problem& problem, std::array<int, 2> base)
    : problem_(problem), base_(base) {
  const auto& joints = problem.robot->description().joints;
  for (int j = 0; j < static_cast<int>(joints.size()); ++j) {
    if (j == base[0] || j == base[1]) continue;
    const double way = std::abs(problem.goal.q[j] - problem.start.q[j]);
    const double moves = way + std::abs(problem.start.qdot[j]);
    if (moves == 0.0) continue;
    const double speed = problem.speed_fraction * joints[idx(j)].max_velocity;
    duration_s_ = std::max(duration_s_, 1.5 * way / speed);
    const double acceleration = joints[idx(j)].max_acceleration;
    if (!std::isfinite(acceleration) || !(acceleration > 0.0)) continue;
    duration_s_ = std::max({duration_s_, std::sqrt(6.0 * way / acceleration) * 1.05,
                            4.0 * std::abs(problem.start.qdot[j]) / acceleration});
  }
}

void OtherJoints::sample(double t, std::span<double> q, std::span<double> qdot) const {
  for (int j = 0; j < static_cast<int>(q.size()); ++j) {
    if (j == base_[0] || j == base_[1]) continue;
    const double q0 = problem_.start.q[j], v0 = problem_.start.qdot[j], q1 = problem_.goal.q[j];
    double at = q1, speed = 0.0;
    if (t < duration_s_) {
      const double h = duration_s_, slope = (q1 - q0) / h;
      const double c2 = (3.0 * slope - 2.0 * v0) / h, c3 = (v0 - 2.0 * slope) / (h * h);
      at = q0 + t * (v0 + t * (c2 + t * c3));
      speed = v0 + t * (2.0 * c2 + 3.0 * t * c3);
    }
    q[idx(j)] = at;
    if (!qdot.empty()) qdot[idx(j)] = speed;
  }
}

BaseClearance::BaseClearance(const Problem& problem, std::array<int, 2> base,
                             const OtherJoints& others, double margin_m, double speed_mps)
    : problem_(problem), base_(base), closing_mps_(speed_mps) {
  const RobotDescription& robot = problem.robot->description();
  const std::size_t spheres = robot.spheres.size(), dof = robot.joints.size();
  const auto looks = 1 + static_cast<std::size_t>(std::ceil(others.duration_s() / kApart_s));
  std::vector<double> q((looks + 2) * dof, 0.0);
  const auto row = [&](std::size_t k) { return std::span(q).subspan(k * dof, dof); };
  for (std::size_t k = 0; k < looks; ++k)
    others.sample(static_cast<double>(k) * kApart_s, row(k), {});
  for (const std::size_t axis : {0, 1}) {
    std::ranges::copy(row(0), row(looks + axis).begin());
    row(looks + axis)[idx(base[axis])] = 1.0;
  }
  offsets_m_.resize((looks + 2) * spheres);
  Scratch scratch;
  problem.robot->sphere_centres(q, offsets_m_, scratch);
  for (const std::size_t axis : {0, 1}) {
    for (std::size_t s = 0; s < spheres; ++s) {
      const Vector3d moved_m = offsets_m_[(looks + axis) * spheres + s] - offsets_m_[s];
      if (s == 0) axes_[axis] = moved_m;
      constexpr double kRounding_m = 1e-9;
      carries_all_ = carries_all_ && (moved_m - axes_[axis]).norm() < kRounding_m;
    }
  }
  offsets_m_.resize(looks * spheres);
  const FloorClearance floor(problem.space, robot);
  double turning_mps = 0.0;  // of spheres about the base
  for (std::size_t look = 0; look < looks; ++look) {
    above_floor_m_.push_back(kInfinity);
    for (std::size_t s = 0; s < spheres; ++s) {
      const Vector3d& at_m = offsets_m_[look * spheres + s];
      above_floor_m_.back() = std::min(above_floor_m_.back(), floor(s, at_m));
      if (look == 0) continue;
      const Vector3d& before_m = offsets_m_[(look - 1) * spheres + s];
      turning_mps = std::max(turning_mps, (at_m - before_m).norm() / kApart_s);
    }
  }
  closing_mps_ += turning_mps;
  for (const Vector3d& offset_m : offsets_m_) {
    around_.centre_link_m += offset_m / static_cast<double>(offsets_m_.size());
  }
  for (std::size_t look = 0; look < looks; ++look) {
    for (std::size_t s = 0; s < spheres; ++s) {
      const double off_m = (offsets_m_[look * spheres + s] - around_.centre_link_m).norm();
      around_.radius_m = std::max(around_.radius_m, off_m + robot.spheres[s].radius_m);
    }
  }
  if (problem.prediction) {
    sets_mps_ = problem.prediction->speed_mps();
    find_outer();
  }
  least_look_s_ = margin_m / (closing_mps_ + sets_mps_);
  centres_m_.resize(spheres);
  distances_m_.resize(spheres);
  statuses_.resize(spheres);
  // It may begin nearer, and comes no nearer than that.
  kept_m_.moving_m = kInfinity;
  kept_m_ = at({problem.start.q[base[0]], problem.start.q[base[1]]}, 0.0);
  kept_m_.standing_m = std::min(kept_m_.standing_m, problem.collision_margin_m + margin_m);
  kept_m_.moving_m = std::min(kept_m_.moving_m, problem.prediction_margin_m + margin_m);
}

bool BaseClearance::passes(const BaseState& from, const Stretch& stretch, double begin_s,
                           double& sure_until_s) {
  if (!is_within(stretch.end.p_m)) return false;
  while (sure_until_s < begin_s + stretch.duration_s) {
    const double clear_s =
        clear_for_s(place_on(from, stretch, sure_until_s - begin_s), sure_until_s);
    if (clear_s < 0.0) return false;
    sure_until_s += std::max(clear_s, least_look_s_);
  }
  return true;
}

double BaseClearance::clear_for_s(const Vector2d& p_m, double time_s) {
  const Clearance clear_m = at(p_m, time_s);
  const double standing_m = clear_m.standing_m - kept_m_.standing_m;
  const double moving_m = clear_m.moving_m - kept_m_.moving_m;
  if (standing_m < 0.0 || moving_m < 0.0) return -1.0;
  // What no frame has seen may begin anywhere.
  if (problem_.space.unknown == Space::kOccupied) return 0.0;
  return std::min(standing_m / closing_mps_, moving_m / (closing_mps_ + sets_mps_));
}

BaseClearance::Clearance BaseClearance::at(const Vector2d& p_m, double time_s) {
  const auto& spheres = problem_.robot->description().spheres;
  const std::size_t look =
      std::min(static_cast<std::size_t>(time_s / kApart_s), above_floor_m_.size() - 1);
  const std::size_t next = std::min(look + 1, above_floor_m_.size() - 1);
  const double share = std::min(time_s / kApart_s - static_cast<double>(look), 1.0);
  const Vector3d base_m = p_m.x() * axes_[0] + p_m.y() * axes_[1];
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    const Vector3d& offset_m = offsets_m_[look * spheres.size() + s];
    centres_m_[s] = base_m + offset_m + share * (offsets_m_[next * spheres.size() + s] - offset_m);
  }
  Clearance clear_m{std::min(above_floor_m_[look], above_floor_m_[next]), kInfinity};
  if (problem_.field) {
    query_with_policy(*problem_.field, problem_.space, centres_m_, distances_m_, {}, statuses_);
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      clear_m.standing_m = std::min(clear_m.standing_m, distances_m_[s] - spheres[s].radius_m);
    }
  }
  if (!problem_.prediction) return clear_m;
  clear_m.moving_m = far_from_moving_m(base_m, time_s);
  constexpr double kFar_m = 0.3;  // beyond the margin: all that is asked for
  if (clear_m.moving_m > kept_m_.moving_m + kFar_m) return clear_m;
  for (std::size_t i = 0; i < outer_.size(); ++i) outer_centres_m_[i] = centres_m_[outer_[i]];
  const std::span distances_m = std::span(distances_m_).first(outer_.size());
  problem_.prediction->query(problem_.prediction_from_s + time_s, outer_centres_m_, distances_m,
                             {});
  clear_m.moving_m = kInfinity;
  for (std::size_t i = 0; i < outer_.size(); ++i) {
    clear_m.moving_m = std::min(clear_m.moving_m, distances_m[i] - spheres[outer_[i]].radius_m);
  }
  return clear_m;
}

/// No sphere is nearer to what is predicted.
double BaseClearance::far_from_moving_m(const Vector3d& base_m, double time_s) const {
  const Vector3d centre_m = base_m + around_.centre_link_m;
  double distance_m = 0.0;
  problem_.prediction->query(problem_.prediction_from_s + time_s, {&centre_m, 1}, {&distance_m, 1},
                             {});
  return distance_m - around_.radius_m;
}

/// Sets are upright: of spheres at their height, seen from above, those within others never are
/// nearest.
void BaseClearance::find_outer() {
  const auto& spheres = problem_.robot->description().spheres;
  double bottom_m = -kInfinity, top_m = kInfinity;  // of all sets alike
  for (const PredictedSet& set : problem_.prediction->sets()) {
    bottom_m = std::max(bottom_m, set.bottom_m);
    top_m = std::min(top_m, set.top_m);
  }
  const auto is_inner = [&](std::size_t s, std::size_t other) {
    for (std::size_t k = 0; k < offsets_m_.size(); k += spheres.size()) {
      const Vector3d &at_m = offsets_m_[k + s], &other_m = offsets_m_[k + other];
      if (other_m.z() < bottom_m || other_m.z() > top_m) return false;
      const double beyond_m =
          (at_m - other_m).head<2>().norm() + spheres[s].radius_m - spheres[other].radius_m;
      if (beyond_m > 0.0 || (beyond_m == 0.0 && s < other)) return false;
    }
    return true;
  };
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    bool is_outer = true;
    for (std::size_t other = 0; is_outer && other < spheres.size(); ++other) {
      is_outer = other == s || !is_inner(s, other);
    }
    if (is_outer) outer_.push_back(s);
  }
  outer_centres_m_.resize(outer_.size());
}

bool BaseClearance::is_within(const Vector2d& p_m) const noexcept {
  const auto& joints = problem_.robot->description().joints;
  for (const std::size_t axis : {0, 1}) {
    const Joint& joint = joints[idx(base_[axis])];
    if (p_m[static_cast<int>(axis)] < joint.lower || p_m[static_cast<int>(axis)] > joint.upper)
      return false;
  }
  return true;
}

}  // namespace sidestep::detail
