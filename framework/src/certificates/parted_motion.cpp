#include "parted_motion.hpp"

#include <algorithm>
#include <cmath>

#include <sidestep/core/index.hpp>

#include "polynomials.hpp"

namespace sidestep {

using polynomials::Coefficients;
using polynomials::value;
using polynomials::way;

PartedMotion::PartedMotion(const KinematicTree& robot, const PolynomialMotion& motion,
                           const std::vector<Body>& shapes)
    : robot_(robot), motion_(motion) {
  for (const Body& shape : shapes) reaches_m_.push_back(shape.reach_m());
  const RobotDescription& description = robot.description();
  for (const CollisionShape& shape : description.shapes) {
    std::vector<int>& carriers = carriers_.emplace_back();
    for (int link = shape.link; link >= 0; link = description.links[idx(link)].parent) {
      const TreeJoint& joint = robot.tree_joints()[idx(link)];
      const bool moves = joint.motion != TreeJoint::Motion::kFixed && joint.joint >= 0;
      if (moves) carriers.push_back(link);
    }
  }
}

std::pair<double, double> PartedMotion::span_s(const MotionPart& part) const {
  const double length_s = std::ldexp(motion_.duration_s(), -part.level);
  const auto index = static_cast<double>(part.index);
  return {length_s * index, length_s * (index + 1.0)};
}

PartedMotion::Instant& PartedMotion::at(const MotionPart& part) {
  const auto [known, is_new] = instants_.try_emplace(part);
  Instant& instant = known->second;
  if (!is_new) return instant;
  const auto [from_s, to_s] = span_s(part);
  instant.time_s = 0.5 * (from_s + to_s);
  const auto after = [](double time_s, const PolynomialPiece& piece) {
    return time_s < piece.end_s;
  };
  const auto& pieces = motion_.pieces;
  const auto at =
      std::min(std::ranges::upper_bound(pieces, instant.time_s, {}, &PolynomialPiece::end_s),
               pieces.end() - 1);
  std::vector<double> q(robot_.description().joints.size());
  for (std::size_t j = 0; j < q.size(); ++j) {
    q[j] = value(at->coefficients[j], instant.time_s - at->begin_s);
  }
  instant.links.resize(robot_.description().links.size());
  robot_.link_poses(q, instant.links, scratch_);
  instant.carried.resize(carriers_.size());
  instant.ways.assign(q.size(), 0.0);
  auto piece = std::upper_bound(pieces.begin(), pieces.end(), from_s, after);
  for (; piece != pieces.end() && piece->begin_s <= to_s; ++piece) {
    const double a = std::max(from_s, piece->begin_s) - piece->begin_s;
    const double b = std::min(to_s, piece->end_s) - piece->begin_s;
    for (std::size_t j = 0; j < q.size(); ++j) {
      const Coefficients& c = piece->coefficients[j];
      // A little longer, for the rounding of times.
      const double half = 0.5 * (b - a) * (1.0 + 1e-12) + 1e-15 * to_s;
      const double middle = 0.5 * (a + b);
      const double off = std::abs(value(c, middle) - q[j]) + way(c, middle, half);
      instant.ways[j] = std::max(instant.ways[j], off);
    }
  }
  return instant;
}

std::span<const PartedMotion::Carried> PartedMotion::carried(Instant& at, std::size_t shape,
                                                             std::size_t carriers) const {
  std::vector<Carried>& carried = at.carried[shape];
  if (!carried.empty() || carriers == 0) return std::span(carried).first(carriers);
  carried.reserve(carriers_[shape].size());
  const CollisionShape& of = robot_.description().shapes[shape];
  const Eigen::Vector3d centre_m = at.links[idx(of.link)] * of.T_link_shape.translation();
  Carried by;
  for (const int link : carriers_[shape]) {
    const TreeJoint& joint = robot_.tree_joints()[idx(link)];
    const double turn = std::abs(joint.multiplier) * at.ways[idx(joint.joint)];
    const Transform& T = at.links[idx(link)];
    const Eigen::Vector3d axis = T.linear() * joint.axis;
    by.turn_m = turn * axis;
    double way_m = turn;
    if (joint.motion == TreeJoint::Motion::kRotation) {
      by.turn_m = turn * axis.cross(centre_m - T.translation());
      const double reach_m = turn * (reaches_m_[shape] + by.way_m);
      way_m = by.turn_m.norm() + reach_m;
      by.more_m += reach_m + 0.5 * turn * way_m;
    }
    by.way_m += way_m;
    carried.push_back(by);
  }
  return std::span(carried).first(carriers);
}

std::size_t PartedMotion::carriers_beyond(int link, std::size_t shape) const {
  // Links stand after their parents.
  return idx(std::ranges::count_if(carriers_[shape], [=](int one) { return one > link; }));
}

}  // namespace sidestep
