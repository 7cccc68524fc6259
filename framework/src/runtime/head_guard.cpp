#include "head_guard.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Between shapes, which are roomier than the robot.
constexpr double kApart_m = 0.005;
/// What it needs to begin turning, to gain speed and to lose it again, by far.
constexpr double kSlack_s = 1.0;
constexpr double kAheadStep_s = 0.25;
constexpr double kTurn_rad = 0.1;  // between two angles that are looked at
/// Bodies that differ by less are one.
constexpr double kSameBody_m = 0.002, kSameBody_rad = 0.01;

bool is_same(const std::vector<Transform>& a, const std::vector<Transform>& b) {
  return std::ranges::equal(a, b, [](const Transform& one, const Transform& other) {
    return (one.translation() - other.translation()).norm() < kSameBody_m &&
           (one.linear() - other.linear()).norm() < kSameBody_rad;
  });
}

}  // namespace

HeadGuard::HeadGuard(std::shared_ptr<const RobotModel> robot, const Head& head)
    : robot_(std::move(robot)),
      head_(head),
      collider_(robot_->description(), {}, {}),
      pose_(collider_.make_pose()) {
  for (int pair = 0; pair < collider_.pair_count(); ++pair) {
    const auto [one, other] = collider_.pair_links(pair);
    if (head_.carries(one) != head_.carries(other)) pairs_.push_back(pair);
  }
}

HeadGuard::Poses HeadGuard::body(std::span<const double> q) {
  const auto& links = robot_->description().links;
  Poses poses(links.size());
  robot_->link_poses(q, poses, scratch_);
  const int carrier = links[idx(head_.description().pan.link)].parent;
  const Transform T_carrier_world = poses[idx(carrier)].inverse();
  for (Transform& pose : poses) pose = T_carrier_world * pose;
  return poses;
}

HeadGuard::Turn HeadGuard::turn(const HeadAngles& from, const HeadAngles& to) const {
  const HeadDescription& head = head_.description();
  return {std::abs(to.pan_rad - from.pan_rad) / head.pan.joint.max_velocity,
          std::abs(to.tilt_rad - from.tilt_rad) / head.tilt.joint.max_velocity};
}

void HeadGuard::see(std::span<const double> q, const Trajectory* way, double from_s,
                    const HeadAngles& at, const HeadAngles& to) {
  std::vector<Poses> bodies{body(q)};
  const double last_s = turn(at, to).both_s() + turn(to, head_.rest()).both_s() + kSlack_s;
  std::vector<double> q_later(q.begin(), q.end());
  for (double ahead_s = kAheadStep_s; way != nullptr && ahead_s < last_s; ahead_s += kAheadStep_s) {
    way->sample(from_s + ahead_s, q_later, {});
    Poses later = body(q_later);
    if (!is_same(later, bodies.back())) bodies.push_back(std::move(later));
  }
  if (std::ranges::equal(bodies, bodies_, is_same)) return;
  bodies_ = std::move(bodies);
  known_.clear();
}

bool HeadGuard::allows(const HeadAngles& angles) {
  const std::pair key{std::lround(1e3 * angles.pan_rad), std::lround(1e3 * angles.tilt_rad)};
  const auto [known, is_new] = known_.emplace(key, true);
  if (!is_new) return known->second;
  for (Poses poses : bodies_) {
    head_.place(angles, poses);
    collider_.place(*pose_, poses, 0.0);
    known->second = std::ranges::none_of(pairs_, [&](int pair) {
      return collider_.gap_between_pair_m(pair, *pose_, kApart_m) < kApart_m;
    });
    if (!known->second) break;
  }
  return known->second;
}

bool HeadGuard::is_way_clear(const HeadAngles& from, const HeadAngles& to) {
  // Each joint turns as fast as it can, and waits for the other at the end.
  const Turn turned = turn(from, to);
  const double turn_rad =
      std::max(std::abs(to.pan_rad - from.pan_rad), std::abs(to.tilt_rad - from.tilt_rad));
  const int steps = std::max(1, static_cast<int>(std::ceil(turn_rad / kTurn_rad)));
  for (int i = 0; i <= steps; ++i) {
    const double time_s = turned.both_s() * i / steps;
    const auto at = [&](double a, double b, double needs_s) {
      return needs_s > 0.0 ? a + (b - a) * std::min(1.0, time_s / needs_s) : b;
    };
    if (!allows({at(from.pan_rad, to.pan_rad, turned.pan_s), at(from.tilt_rad, to.tilt_rad, turned.tilt_s)})) {
      return false;
    }
  }
  return true;
}

HeadAngles HeadGuard::nearest(const HeadAngles& at, const HeadAngles& wanted) {
  if (is_way_clear(wanted, head_.rest())) return is_way_clear(at, wanted) ? wanted : head_.rest();
  return is_way_clear(at, head_.rest()) ? at : head_.rest();
}

bool HeadGuard::may_rest(const HeadAngles& at, const HeadAngles& told) {
  return is_way_clear(at, told) && is_way_clear(told, head_.rest());
}

}  // namespace sidestep
