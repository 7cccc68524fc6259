#include "head_guard.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

/// Between shapes, which are roomier than the robot, at the places that are looked at.
constexpr double kApart_m = 0.02;
constexpr double kLattice_rad = 0.1;
/// What a head needs beside the time on its way: to hear, to gain speed and to lose it.
constexpr double kSlack_s = 1.0;
constexpr double kAheadStep_s = 0.2;
/// Bodies that differ by less are one.
constexpr double kSameBody_m = 0.005, kSameBody_rad = 0.03;

HeadAngles angles_of(const std::pair<int, int>& place) {
  return {kLattice_rad * place.first, kLattice_rad * place.second};
}

}  // namespace

HeadGuard::HeadGuard(std::shared_ptr<const RobotModel> robot, const Head& head, double margin_m)
    : robot_(std::move(robot)),
      head_(head),
      collider_(robot_->description(), {}, {}),
      pose_(collider_.make_pose()),
      margin_m_(margin_m) {
  const auto farthest_s = [](const Joint& joint, double rest_rad) {
    return std::max(joint.upper - rest_rad, rest_rad - joint.lower) / joint.max_velocity;
  };
  const HeadDescription& joints = head_.description();
  ahead_s_ = kSlack_s + std::max(farthest_s(joints.pan.joint, head_.rest().pan_rad),
                                 farthest_s(joints.tilt.joint, head_.rest().tilt_rad));
  std::vector<bool> is_paired(robot_->description().links.size());
  for (int pair = 0; pair < collider_.pair_count(); ++pair) {
    const auto [one, other] = collider_.pair_links(pair);
    if (head_.carries(one) == head_.carries(other)) continue;
    pairs_.push_back(pair);
    is_paired[idx(one)] = is_paired[idx(other)] = true;
  }
  for (const CollisionSphere& sphere : robot_->description().spheres) {
    if (head_.carries(sphere.link)) {
      head_spheres_.push_back(sphere);
    } else if (is_paired[idx(sphere.link)]) {
      body_spheres_.push_back(sphere);
    }
  }
  poses_ = body(std::vector<double>(idx(robot_->description().dof()), 0.0)).poses;
  rest_ = turned(head_.rest());
  const Eigen::Vector3d pans_m = poses_[idx(joints.pan.link)].translation();
  const Eigen::Vector3d tilts_m = poses_[idx(joints.tilt.link)].translation();
  for (const CollisionSphere& sphere : head_spheres_) {
    const Eigen::Vector3d centre_m = poses_[idx(sphere.link)] * sphere.centre_link_m;
    const double from_m = std::max((centre_m - pans_m).norm(),
                                   (centre_m - tilts_m).norm() + (tilts_m - pans_m).norm());
    reach_m_ = std::max(reach_m_, from_m + sphere.radius_m);
  }
}

HeadGuard::Body HeadGuard::body(std::span<const double> q) {
  const auto& links = robot_->description().links;
  Body body{std::vector<Transform>(links.size()), {}, {}};
  robot_->link_poses(q, body.poses, scratch_);
  const int carrier = links[idx(head_.description().pan.link)].parent;
  body.T_world_carrier = body.poses[idx(carrier)];
  const Transform T_carrier_world = body.T_world_carrier.inverse();
  for (Transform& pose : body.poses) pose = T_carrier_world * pose;
  for (const CollisionSphere& sphere : body_spheres_) {
    body.centres_m.emplace_back(body.poses[idx(sphere.link)] * sphere.centre_link_m);
  }
  return body;
}

void HeadGuard::see(std::span<const double> q, const Trajectory* way, double from_s,
                    std::shared_ptr<const DistanceField> field) {
  const auto is_same = [](const Body& a, const Body& b) {
    return std::ranges::equal(a.poses, b.poses, [](const Transform& one, const Transform& other) {
      return (one.translation() - other.translation()).norm() < kSameBody_m &&
             (one.linear() - other.linear()).norm() < kSameBody_rad;
    });
  };
  std::vector<Body> bodies;
  bodies.push_back(body(q));
  field_ = std::move(field);
  spots_.clear();
  clear_.clear();
  see_spot(bodies.back().T_world_carrier);
  std::vector<double> q_later(q.begin(), q.end());
  for (double ahead_s = kAheadStep_s; way != nullptr && ahead_s <= ahead_s_;
       ahead_s += kAheadStep_s) {
    way->sample(from_s + ahead_s, q_later, {});
    Body later = body(q_later);
    see_spot(later.T_world_carrier);
    if (!is_same(later, bodies.back())) bodies.push_back(std::move(later));
  }
  if (std::ranges::equal(bodies, bodies_, is_same)) return;
  bodies_ = std::move(bodies);
  known_.clear();
}

void HeadGuard::see_spot(const Transform& T_world_carrier) {
  if (!field_) return;
  const auto pan = idx(head_.description().pan.link);
  centres_m_.assign(1, T_world_carrier * poses_[pan].translation());
  distances_m_.resize(1);
  field_->query(centres_m_, distances_m_, {}, {});
  if (distances_m_[0] >= reach_m_ + margin_m_) return;
  spots_.push_back({T_world_carrier, std::min(margin_m_, clearance_m(rest_, T_world_carrier))});
}

double HeadGuard::clearance_m(const Turned& head, const Transform& T_world_carrier) {
  centres_m_.clear();
  for (const Eigen::Vector3d& centre : head.centres_m) {
    centres_m_.push_back(T_world_carrier * centre);
  }
  distances_m_.resize(centres_m_.size());
  field_->query(centres_m_, distances_m_, {}, {});
  double least_m = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < distances_m_.size(); ++i) {
    least_m = std::min(least_m, distances_m_[i] - head_spheres_[i].radius_m);
  }
  return least_m;
}

/// As far as it is at rest.
bool HeadGuard::is_clear_of_obstacles(const Turned& head) {
  return std::ranges::all_of(spots_, [&](const Spot& spot) {
    return clearance_m(head, spot.T_world_carrier) >= spot.margin_m;
  });
}

bool HeadGuard::is_clear(std::initializer_list<HeadAngles> between) {
  HeadAngles least = head_.rest();
  HeadAngles most = least;
  for (const HeadAngles& angles : between) {
    least = {std::min(least.pan_rad, angles.pan_rad), std::min(least.tilt_rad, angles.tilt_rad)};
    most = {std::max(most.pan_rad, angles.pan_rad), std::max(most.tilt_rad, angles.tilt_rad)};
  }
  const auto place = [](double angle_rad, auto round) {
    return static_cast<int>(round(angle_rad / kLattice_rad));
  };
  const auto floor = [](double x) { return std::floor(x + 1e-9); };
  const auto ceil = [](double x) { return std::ceil(x - 1e-9); };
  for (int pan = place(least.pan_rad, floor); pan <= place(most.pan_rad, ceil); ++pan) {
    for (int tilt = place(least.tilt_rad, floor); tilt <= place(most.tilt_rad, ceil); ++tilt) {
      if (!is_apart({pan, tilt})) return false;
    }
  }
  return true;
}

HeadGuard::Turned HeadGuard::turned(const HeadAngles& angles) const {
  std::vector<Transform> poses = poses_;
  head_.place(angles, poses);
  Turned head;
  head.middle_m.setZero();
  for (const CollisionSphere& sphere : head_spheres_) {
    head.centres_m.emplace_back(poses[idx(sphere.link)] * sphere.centre_link_m);
    head.middle_m += head.centres_m.back() / static_cast<double>(head_spheres_.size());
  }
  for (std::size_t i = 0; i < head_spheres_.size(); ++i) {
    head.radius_m = std::max(
        head.radius_m, (head.centres_m[i] - head.middle_m).norm() + head_spheres_[i].radius_m);
  }
  return head;
}

bool HeadGuard::is_apart(const Place& place) {
  const HeadAngles angles = angles_of(place);
  auto head = heads_.find(place);
  if (head == heads_.end()) head = heads_.emplace(place, turned(angles)).first;
  const auto [clear, is_new_place] = clear_.emplace(place, true);
  if (is_new_place) clear->second = is_clear_of_obstacles(head->second);
  if (!clear->second) return false;
  const auto [known, is_new] = known_.emplace(place, true);
  if (is_new) {
    known->second = std::ranges::all_of(
        bodies_, [&](const Body& body) { return is_apart(angles, head->second, body); });
  }
  return known->second;
}

/// Spheres enclose the shapes: where they are apart, these are.
bool HeadGuard::is_apart(const HeadAngles& angles, const Turned& head, const Body& body) {
  if (are_spheres_apart(head, body)) return true;
  std::vector<Transform> poses = body.poses;
  head_.place(angles, poses);
  collider_.place(*pose_, poses, 0.0);
  return std::ranges::none_of(pairs_, [&](int pair) {
    return collider_.gap_between_pair_m(pair, *pose_, kApart_m) < kApart_m;
  });
}

bool HeadGuard::are_spheres_apart(const Turned& head, const Body& body) const {
  for (std::size_t b = 0; b < body.centres_m.size(); ++b) {
    const double radius_m = body_spheres_[b].radius_m + kApart_m;
    if ((body.centres_m[b] - head.middle_m).norm() >= radius_m + head.radius_m) continue;
    for (std::size_t a = 0; a < head.centres_m.size(); ++a) {
      const double reach_m = radius_m + head_spheres_[a].radius_m;
      if ((body.centres_m[b] - head.centres_m[a]).norm() < reach_m) return false;
    }
  }
  return true;
}

}  // namespace sidestep
