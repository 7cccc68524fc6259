#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/index.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// Upper bounds on how far spheres move per unit of each joint ("levers", m per m or m per
/// rad). Holds for every open chain in which a joint either turns a link about an axis through
/// the link's origin or shifts it along a line, both linear in the joint's position: every
/// robot that URDF can describe. Which joint moves which link is found by probing
/// link_poses(), so any RobotModel will do.
///
/// The lever of a turning joint is at most the rate of turning times the longest way from the
/// link's origin along the chain to the sphere, with prismatic joints at their worst.
class MotionBounds {
 public:
  explicit MotionBounds(const RobotModel& robot);

  /// Of a sphere's centre against the world, over all configurations within limits: dof values.
  [[nodiscard]] std::span<const double> sphere_levers(int sphere) const noexcept {
    return row(sphere_levers_, sphere);
  }

  /// Of any sphere of one link against any of the other, for self_collision_pairs[pair]: dof
  /// values. Joints that carry both links together count nothing.
  [[nodiscard]] std::span<const double> pair_levers(int pair) const noexcept {
    return row(pair_levers_, pair);
  }

  /// Tighter bounds for a motion that starts where `jacobians` (spheres x dof columns) was
  /// taken and moves each joint by at most `variation` (dof, total variation) in all:
  /// |J_sj| grows by at most rate_j * sum of lever_sk * variation_k over the joints k that lie
  /// between joint j and the sphere, and never by those before j. levers: spheres x dof.
  void local_levers(std::span<const Eigen::Vector3d> jacobians, std::span<const double> variation,
                    std::span<double> levers) const noexcept;

  /// Of a sphere's centre on a straight motion: how far, at most, its velocity changes in a unit of
  /// time when each joint moves at the constant speed `variation` (dof): m per unit of time
  /// squared. The velocity that joint k gives it turns with the joints k lies beyond, and it with
  /// them. Infinity where a moving joint moves several links of the chain.
  [[nodiscard]] double bend(int sphere, std::span<const double> variation) const noexcept;

 private:
  struct Probe;

  [[nodiscard]] std::span<const double> row(const std::vector<double>& table,
                                            int index) const noexcept {
    return std::span(table).subspan(idx(index) * dof_, dof_);
  }
  void fill_sphere_levers(const RobotDescription& robot, const Probe& probe);
  void fill_pair_levers(const RobotDescription& robot, const Probe& probe);
  void fill_order(const RobotDescription& robot, const Probe& probe);

  std::size_t dof_ = 0;
  std::vector<double> sphere_levers_;
  std::vector<double> pair_levers_;
  std::vector<int> sphere_link_;
  /// links x dof: rad per unit of the joint where exactly one link of the chain is turned by
  /// it, 0 where none is turned, negative where several are moved (no tighter bound).
  std::vector<double> turn_rate_;
  /// links x dof x dof: 1 where joint k (last index) lies between joint j and the link.
  std::vector<char> is_beyond_;
};

}  // namespace sidestep
