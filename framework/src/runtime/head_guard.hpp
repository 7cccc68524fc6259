#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/robot/head.hpp>
#include <sidestep/trajectory/trajectory.hpp>

#include "shape_collider.hpp"

namespace sidestep {

/// Keeps a head that turns apart from the rest of its robot, by the collision shapes of its URDF.
/// Motions are planned with the head at rest. [planning]
class HeadGuard {
 public:
  HeadGuard(std::shared_ptr<const RobotModel> robot, const Head& head);

  /// Looks at the robot in a configuration, and as a way, which may be null, goes on from a time of
  /// it for as long as the head needs from `at` to `to` and then to its rest.
  void see(std::span<const double> q, const Trajectory* way, double from_s, const HeadAngles& at,
           const HeadAngles& to);
  /// Whether the head keeps apart there.
  [[nodiscard]] bool allows(const HeadAngles& angles);
  /// Where the head, which is at `at`, may turn so that it gets to its rest from anywhere on the
  /// way: to `wanted`, by its rest where the straight way is not clear; else it stays, else to its
  /// rest.
  [[nodiscard]] HeadAngles nearest(const HeadAngles& at, const HeadAngles& wanted);
  /// Whether it keeps apart while it turns from `at` to where it was told to, and on to its rest.
  [[nodiscard]] bool may_rest(const HeadAngles& at, const HeadAngles& told);

 private:
  using Poses = std::vector<Transform>;  ///< Of all links, in the frame of what carries the head.

  [[nodiscard]] Poses body(std::span<const double> q);
  /// How long each joint takes from one angle to another.
  struct Turn {
    double pan_s, tilt_s;
    [[nodiscard]] double both_s() const { return std::max(pan_s, tilt_s); }
  };
  [[nodiscard]] Turn turn(const HeadAngles& from, const HeadAngles& to) const;
  [[nodiscard]] bool is_way_clear(const HeadAngles& from, const HeadAngles& to);

  std::shared_ptr<const RobotModel> robot_;
  Head head_;
  ShapeCollider collider_;
  ShapeCollider::PosePtr pose_;
  std::vector<int> pairs_;  ///< Of shapes, of which the head carries one.
  std::vector<Poses> bodies_;  ///< Different ones.
  std::map<std::pair<long, long>, bool> known_;  ///< Of these bodies; angles in milliradians.
  Scratch scratch_;
};

}  // namespace sidestep
