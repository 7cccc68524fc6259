#include "motion_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

constexpr double kProbeStep = 0.1;      // m, rad
constexpr double kProbeNothing = 1e-9;  // m, rad: below it a joint does not move a link
constexpr int kProbes = 3;

double mid_position(const Joint& joint) {
  if (std::isfinite(joint.lower) && std::isfinite(joint.upper)) {
    return 0.5 * (joint.lower + joint.upper);
  }
  return 0.0;
}

/// Largest distance of a position within the limits from mid_position().
double half_range(const Joint& joint) {
  return std::max(joint.upper - mid_position(joint), mid_position(joint) - joint.lower);
}

Transform against_parent(const RobotDescription& robot, const std::vector<Transform>& T_world_link,
                         int link) {
  const int parent = robot.links[idx(link)].parent;
  if (parent < 0) return T_world_link[idx(link)];
  return T_world_link[idx(parent)].inverse() * T_world_link[idx(link)];
}

std::vector<int> chain_to(const RobotDescription& robot, int link) {
  std::vector<int> chain;
  for (int at_link = link; at_link >= 0; at_link = robot.links[idx(at_link)].parent) {
    chain.push_back(at_link);
  }
  std::reverse(chain.begin(), chain.end());
  return chain;
}

}  // namespace

/// What each joint does to each link against its parent, and how long each link's offset is.
struct MotionBounds::Probe {
  explicit Probe(const RobotModel& model);

  [[nodiscard]] double turn(int link, std::size_t joint) const {
    return turn_rate[idx(link) * dof + joint];
  }
  [[nodiscard]] double shift(int link, std::size_t joint) const {
    return shift_rate[idx(link) * dof + joint];
  }
  [[nodiscard]] bool moves(int link, std::size_t joint) const {
    return turn(link, joint) > 0.0 || shift(link, joint) > 0.0;
  }
  /// Bound on |d p / d q_joint| for a point fixed in the last link of `chain`, `distance_m`
  /// from its origin, counting what happens at chain[first] and later.
  [[nodiscard]] double lever(const std::vector<int>& chain, std::size_t first, double distance_m,
                             std::size_t joint) const;

  std::size_t dof = 0;
  std::vector<double> turn_rate;   // links x dof, rad per unit
  std::vector<double> shift_rate;  // links x dof, m per unit
  std::vector<double> offset_m;    // links: longest way from the parent's origin
};

MotionBounds::Probe::Probe(const RobotModel& model) {
  const RobotDescription& robot = model.description();
  dof = robot.joints.size();
  const std::size_t links = robot.links.size();
  turn_rate.assign(links * dof, 0.0);
  shift_rate.assign(links * dof, 0.0);
  offset_m.assign(links, 0.0);

  Scratch scratch;
  std::vector<double> q(dof);
  std::vector<Transform> rest(links);
  std::vector<Transform> moved(links);
  for (int probe = 0; probe < kProbes; ++probe) {
    for (std::size_t j = 0; j < dof; ++j) {
      const double spread = std::min(1.0, half_range(robot.joints[j]));
      q[j] = mid_position(robot.joints[j]) +
             0.5 * probe * spread * std::sin(1.0 + static_cast<double>(j));
    }
    model.link_poses(q, rest, scratch);
    for (std::size_t j = 0; j < dof; ++j) {
      const double kept = q[j];
      q[j] = kept + kProbeStep;
      model.link_poses(q, moved, scratch);
      q[j] = kept;
      for (int link = 0; link < static_cast<int>(links); ++link) {
        const Transform a = against_parent(robot, rest, link);
        const Transform b = against_parent(robot, moved, link);
        const Eigen::Matrix3d turned = a.linear().transpose() * b.linear();
        const double angle = Eigen::AngleAxisd(turned).angle();
        const double shift_m = (b.translation() - a.translation()).norm();
        const std::size_t entry = idx(link) * dof + j;
        if (angle > kProbeNothing) {
          turn_rate[entry] = std::max(turn_rate[entry], angle / kProbeStep);
        }
        if (shift_m > kProbeNothing) {
          shift_rate[entry] = std::max(shift_rate[entry], shift_m / kProbeStep);
        }
      }
    }
    if (probe > 0) continue;  // offsets: from the middle of the ranges
    for (int link = 0; link < static_cast<int>(links); ++link) {
      offset_m[idx(link)] = against_parent(robot, rest, link).translation().norm();
    }
  }
  for (std::size_t link = 0; link < links; ++link) {
    for (std::size_t j = 0; j < dof; ++j) {
      const double rate = shift_rate[link * dof + j];
      if (rate > 0.0) offset_m[link] += rate * half_range(robot.joints[j]);
    }
  }
}

double MotionBounds::Probe::lever(const std::vector<int>& chain, std::size_t first,
                                  double distance_m, std::size_t joint) const {
  double sum = 0.0;
  double reach_m = distance_m;
  for (std::size_t i = chain.size(); i-- > first;) {
    const int link = chain[i];
    if (turn(link, joint) > 0.0) sum += turn(link, joint) * reach_m;
    sum += shift(link, joint);
    reach_m += offset_m[idx(link)];
  }
  return sum;
}

MotionBounds::MotionBounds(const RobotModel& robot) : dof_(robot.description().joints.size()) {
  const Probe probe(robot);
  fill_sphere_levers(robot.description(), probe);
  fill_pair_levers(robot.description(), probe);
  fill_order(robot.description(), probe);
}

void MotionBounds::fill_sphere_levers(const RobotDescription& robot, const Probe& probe) {
  for (const CollisionSphere& sphere : robot.spheres) {
    sphere_link_.push_back(sphere.link);
    const std::vector<int> chain = chain_to(robot, sphere.link);
    for (std::size_t j = 0; j < dof_; ++j) {
      sphere_levers_.push_back(probe.lever(chain, 0, sphere.centre_link_m.norm(), j));
    }
  }
}

void MotionBounds::fill_pair_levers(const RobotDescription& robot, const Probe& probe) {
  std::vector<double> extent_m(robot.links.size(), 0.0);
  for (const CollisionSphere& sphere : robot.spheres) {
    double& extent = extent_m[idx(sphere.link)];
    extent = std::max(extent, sphere.centre_link_m.norm());
  }
  for (const auto& [first, second] : robot.self_collision_pairs) {
    const std::vector<int> a = chain_to(robot, first);
    const std::vector<int> b = chain_to(robot, second);
    std::size_t common = 0;
    while (common < std::min(a.size(), b.size()) && a[common] == b[common]) ++common;
    for (std::size_t j = 0; j < dof_; ++j) {
      pair_levers_.push_back(probe.lever(a, common, extent_m[idx(first)], j) +
                             probe.lever(b, common, extent_m[idx(second)], j));
    }
  }
}

void MotionBounds::fill_order(const RobotDescription& robot, const Probe& probe) {
  const std::size_t links = robot.links.size();
  turn_rate_.assign(links * dof_, 0.0);
  is_beyond_.assign(links * dof_ * dof_, 0);
  for (std::size_t link = 0; link < links; ++link) {
    const std::vector<int> chain = chain_to(robot, static_cast<int>(link));
    for (std::size_t j = 0; j < dof_; ++j) {
      std::vector<std::size_t> moved;
      for (std::size_t i = 0; i < chain.size(); ++i) {
        if (probe.moves(chain[i], j)) moved.push_back(i);
      }
      double& rate = turn_rate_[link * dof_ + j];
      if (moved.size() > 1) {
        rate = -1.0;
        continue;
      }
      if (moved.empty()) continue;
      rate = probe.turn(chain[moved.front()], j);
      for (std::size_t k = 0; k < dof_; ++k) {
        for (std::size_t i = moved.front(); k != j && i < chain.size(); ++i) {
          if (probe.moves(chain[i], k)) is_beyond_[(link * dof_ + j) * dof_ + k] = 1;
        }
      }
    }
  }
}

void MotionBounds::local_levers(std::span<const Eigen::Vector3d> jacobians,
                                std::span<const double> variation,
                                std::span<double> levers) const noexcept {
  for (std::size_t s = 0; s < sphere_link_.size(); ++s) {
    const std::span<const double> widest = sphere_levers(static_cast<int>(s));
    const std::size_t link = idx(sphere_link_[s]);
    for (std::size_t j = 0; j < dof_; ++j) {
      double& lever = levers[s * dof_ + j];
      lever = widest[j];
      const double rate = turn_rate_[link * dof_ + j];
      if (rate < 0.0 || variation[j] == 0.0) continue;
      double growth = 0.0;
      for (std::size_t k = 0; k < dof_ && rate > 0.0; ++k) {
        if (is_beyond_[(link * dof_ + j) * dof_ + k] != 0 && variation[k] > 0.0) {
          growth += widest[k] * variation[k];
        }
      }
      lever = std::min(lever, jacobians[s * dof_ + j].norm() + rate * growth);
    }
  }
}

double MotionBounds::bend(int sphere, std::span<const double> variation) const noexcept {
  const std::span<const double> levers = sphere_levers(sphere);
  const std::size_t link = idx(sphere_link_[idx(sphere)]);
  double bend = 0.0;
  for (std::size_t j = 0; j < dof_; ++j) {
    const double rate = turn_rate_[link * dof_ + j];
    if (variation[j] == 0.0 || rate == 0.0) continue;
    if (rate < 0.0) return std::numeric_limits<double>::infinity();
    double beyond = 0.0;
    for (std::size_t k = 0; k < dof_; ++k) {
      if (is_beyond_[(link * dof_ + j) * dof_ + k] != 0 && variation[k] > 0.0) {
        beyond += levers[k] * variation[k];
      }
    }
    bend += rate * variation[j] * (levers[j] * variation[j] + 2.0 * beyond);
  }
  return bend;
}

}  // namespace sidestep
